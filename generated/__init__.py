"""What softdyn wrote for the stock laws (``softdyn generate --stock``): committed, never edited."""
