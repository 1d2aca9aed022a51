"""Where pickles of a :class:`Batch` from before ``softdyn.pair`` was a package look for it."""

from softdyn.pair.batch import Batch as Batch
