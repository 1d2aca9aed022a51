"""Results as GSD and VTK files, read back by the readers of others."""

from __future__ import annotations

import sys
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Any

import gsd.hoomd
import meshio
import numpy as np
import pytest

from softdyn.cli import main
from softdyn.errors import SceneError
from softdyn.particles.geometry import Wall
from softdyn.particles.observables import strain
from softdyn.particles.particle_keys import ParticleScene, Push
from softdyn.particles.particle_run import simulate_particles
from softdyn.particles.results import ParticleResult, load_particles

UNIT = {"E": 1.0, "eta": 1.0}


@pytest.fixture(scope="module")
def sheared() -> ParticleResult:
    """A periodic packing of two species, sheared so far that its box is seen tilted the other way."""
    draw = np.random.default_rng(1)
    place = np.array([[i + 0.5 * (j % 2), j * np.sqrt(3) / 2] for j in range(6) for i in range(6)]) * 1.9
    box = np.array([6.0, 3 * np.sqrt(3)]) * 1.9
    return simulate_particles(
        ParticleScene(
            law="rognon_gay",
            parameters={"E": {"hard": 2.0, "soft": 1.0}, "eta": 1.0},
            positions=np.mod(place + 0.02 * draw.uniform(-1, 1, place.shape), box),
            radii=draw.uniform(0.95, 1.0, len(place)),
            species=["soft" if k % 3 else "hard" for k in range(len(place))],
            box=list(box),
            gap=0.05,
            range=0.4,
            shear_rate=1e-3,
            drag=1.0,
            until_t=800.0,
            times=5,
            rtol=1e-2,
        )
    )


@pytest.fixture(scope="module")
def walled() -> ParticleResult:
    """A pair in three dimensions that falls on a wall; at the start nothing is in touch."""
    return simulate_particles(
        ParticleScene(
            law="rognon_gay",
            parameters=UNIT,
            positions=[[0.0, 0.0, 2.0], [0.5, 0.0, 5.0]],
            radii=[1.0, 1.2],
            wall=[Wall(np.zeros(3), np.array([0.0, 0.0, -1.0]))],
            push=[Push([0, 1], [0.0, 0.0, -0.1])],
            range=0.4,
            drag=1.0,
            until_t=1000.0,
            times=6,
        )
    )


@pytest.fixture(scope="module", params=[2, 3])
def sliding(request: pytest.FixtureRequest) -> ParticleResult:
    """Two particles that a shear flow turns and slides on each other, on a wall that moves."""
    d: int = request.param
    pad = [0.0] * (d - 2)
    return simulate_particles(
        ParticleScene(
            law="equal_spheres",
            parameters={**UNIT, "nu": 0.5},
            positions=[[0.0, 0.0, *pad], [1.0, 1.8, *pad]],
            radii=1.0,
            wall=[Wall(np.array([0.0, -1.1, *pad]), np.array([0.0, -1.0, *pad]))],
            shear_rate=1e-3,
            range=0.5,
            tangential=True,
            drag=1.0,
            until_t=300.0,
            times=3,
        )
    )


def test_a_gsd_trajectory_is_the_result_in_single_precision(sheared: ParticleResult, tmp_path: Path) -> None:
    """Positions, unwrapped by the images, and velocities to the rounding of 24 bits; contacts as they are."""
    count = len(sheared.radii)
    with gsd.hoomd.open(str(sheared.save(tmp_path / "a.gsd"))) as trajectory:
        assert len(trajectory) == len(sheared)
        for number, frame in enumerate(trajectory):
            Lx, Ly, Lz, xy, xz, yz = (float(value) for value in frame.configuration.box)
            cell = np.array([[Lx, xy * Ly, xz * Lz], [0, Ly, yz * Lz], [0, 0, Lz]])
            assert frame.configuration.dimensions == 2
            assert abs(xy * Ly) <= Lx / 2 * (1 + 1e-6)  # the least tilted cell
            x = np.asarray(frame.particles.position, float)
            fractions = np.linalg.solve(cell, x.T).T
            assert np.abs(fractions).max() <= 0.5 + 1e-6
            whole = (x + (frame.particles.image + 0.5) @ cell.T)[:, :2]
            scale = np.abs(sheared.x[number]).max() + np.abs(cell).max() * (1 + np.abs(frame.particles.image).max())
            np.testing.assert_allclose(whole, sheared.x[number], atol=4 * 2.0**-24 * scale)
            np.testing.assert_allclose(frame.particles.velocity[:, :2], sheared.v[number], rtol=2.0**-23)
            np.testing.assert_allclose(frame.particles.diameter, 2 * sheared.radii, rtol=2.0**-23)
            names = [frame.particles.types[k] for k in frame.particles.typeid]
            assert names == ["soft" if k % 3 else "hard" for k in range(count)]
            contacts = sheared.contacts(number)
            assert np.array_equal(frame.bonds.group, np.column_stack([contacts["i"], contacts["j"]]))
            assert np.array_equal(frame.log["bonds/gap"], contacts["h"])
            assert np.array_equal(frame.log["bonds/force"], contacts["F"])
            assert np.array_equal(frame.log["stress"], sheared.stress[number])
            assert float(frame.log["t"][0]) == sheared.t[number]
            assert float(frame.log["strain"][0]) == pytest.approx(1e-3 * sheared.t[number])
            # a viewer draws a bond to the nearest image: that is the contact, of the length that its gap says
            i, j = frame.bonds.group.T
            along = np.linalg.solve(cell, (x[j] - x[i]).T).T
            r = np.linalg.norm((along - np.round(along)) @ cell.T, axis=1)
            expected = sheared.radii[i] + sheared.radii[j] + contacts["h"] - 2 * contacts["delta"]
            np.testing.assert_allclose(r, expected, rtol=1e-5)


def test_contacts_come_and_go_in_a_gsd_trajectory(walled: ParticleResult, tmp_path: Path) -> None:
    """Those with walls are no bonds; a frame without contacts has none of another frame's."""
    counts = []
    with gsd.hoomd.open(str(walled.save(tmp_path / "a.gsd"))) as trajectory:
        for number, frame in enumerate(trajectory):
            pair = walled.contacts(number)["j"] < 2
            counts.append(frame.bonds.N)
            assert frame.bonds.N == len(frame.log["bonds/gap"]) == pair.sum()
            centre = frame.particles.position + np.asarray(frame.configuration.box[:3]) * 0
            np.testing.assert_allclose(centre[1] - centre[0], walled.x[number, 1] - walled.x[number, 0], atol=1e-5)
    assert counts[0] == 0 < counts[-1]


@pytest.mark.slow
def test_netcdf_holds_all_arrays_and_csv_strain_and_stress(sheared: ParticleResult, tmp_path: Path) -> None:
    xarray, pandas = pytest.importorskip("xarray"), pytest.importorskip("pandas")
    with xarray.open_dataset(sheared.save(tmp_path / "sheared.nc"), engine="scipy") as held:
        for name, values in sheared.arrays.items():
            assert name in held.variables or not values.size
            assert not values.size or np.array_equal(held[name].values, values)
    read = pandas.read_csv(sheared.save(tmp_path / "sheared.csv"))
    assert read["t"].to_numpy() == pytest.approx(sheared.t, rel=1e-15)
    assert read["strain"].to_numpy() == pytest.approx(strain(sheared), rel=1e-15)
    assert read["stress_xy"].to_numpy() == pytest.approx(sheared.stress[:, 0, 1], rel=1e-15)


def test_what_slides_and_turns_is_in_both(sliding: ParticleResult, tmp_path: Path) -> None:
    """As vectors in space: in the plane particles turn about z."""
    d = sliding.x.shape[2]
    spin = np.zeros((len(sliding), 2, 3))
    spin[..., -1 if d == 2 else slice(None)] = sliding.spin[..., 0] if d == 2 else sliding.spin
    assert np.abs(spin[-1, :, 2]).min() > 0
    entries = files_of(sliding.save(tmp_path / "a.pvd"))
    assert {part for _, part, _ in entries} == {"0", "1"}
    with gsd.hoomd.open(str(sliding.save(tmp_path / "a.gsd"))) as trajectory:
        for number, frame in enumerate(trajectory):
            contacts = sliding.contacts(number)
            T = np.pad(contacts["T"], ((0, 0), (0, 3 - d)))
            assert np.array_equal(frame.log["particles/spin"], spin[number])
            assert np.array_equal(frame.log["bonds/tangential"], T[contacts["j"] < 2])
            particles, lines = (meshio.read(file) for t, _, file in entries if t == sliding.t[number])
            assert np.array_equal(particles.point_data["spin"], spin[number])
            assert np.array_equal(lines.cell_data["tangential"][0], T)
    assert np.abs(sliding.contacts(-1)["T"]).max(axis=1).min() > 0


def files_of(path: Path) -> list[tuple[float, str, Path]]:
    """Time, part and file of each entry of a .pvd."""
    entries = ElementTree.parse(path).getroot().iter("DataSet")
    return [(float(e.attrib["timestep"]), e.attrib["part"], path.parent / e.attrib["file"]) for e in entries]


@pytest.mark.parametrize("which", ["sheared", "walled"])
def test_vtk_files_are_the_result(which: str, tmp_path: Path, request: pytest.FixtureRequest) -> None:
    """In full precision; a contact is a line as long as its gap says, from a particle."""
    result: ParticleResult = request.getfixturevalue(which)
    d = result.x.shape[2]
    entries = files_of(result.save(tmp_path / "some" / "a.pvd"))
    with_contacts = [k for k in range(len(result)) if len(result.contacts(k)["h"])]
    assert [t for t, part, _ in entries if part == "0"] == result.t.tolist()
    assert [t for t, part, _ in entries if part == "1"] == result.t[with_contacts].tolist()
    assert [t for t, part, _ in entries if part == "2"] == (result.t.tolist() if which == "sheared" else [])
    for t, part, file in entries:
        number = result.t.tolist().index(t)
        if part == "2":
            continue
        mesh = meshio.read(file)
        if part == "0":
            assert np.array_equal(mesh.point_data["radius"].reshape(-1), result.radii)
            assert np.array_equal(mesh.point_data["velocity"][:, :d], result.v[number])
            shift = mesh.points[:, :d] - result.x[number]
            if which == "walled":
                assert np.array_equal(shift, np.zeros_like(shift))
            else:  # by whole vectors of the lattice
                fractions = np.linalg.solve(result.cell[number], shift.T)
                np.testing.assert_allclose(fractions, np.round(fractions), atol=1e-9)
            continue
        contacts = result.contacts(number)
        assert np.array_equal(mesh.cell_data["gap"][0].reshape(-1), contacts["h"])
        assert np.array_equal(mesh.cell_data["force"][0].reshape(-1), contacts["F"])
        start, end = mesh.points[mesh.cells[0].data].transpose(1, 0, 2)
        assert np.array_equal(mesh.cells[0].data[:, 0], contacts["i"])
        partner = np.append(result.radii, 0.0)[np.minimum(contacts["j"], len(result.radii))]
        expected = result.radii[contacts["i"]] + partner + contacts["h"] - 2 * contacts["delta"]
        along = (end - start)[:, :d]
        np.testing.assert_allclose(np.linalg.norm(along, axis=1), expected, rtol=1e-9)
        np.testing.assert_allclose(along / expected[:, None], contacts["n"], atol=1e-6)
        if which == "walled":
            np.testing.assert_allclose(end[contacts["j"] == 2, 2], 0.0, atol=1e-9)


def test_the_box_is_that_of_the_particles_as_it_leans(sheared: ParticleResult, tmp_path: Path) -> None:
    """Twelve edges, of the lengths of the lattice's vectors; all particles are within."""
    leans = []
    for t, part, file in files_of(sheared.save(tmp_path / "a.pvd")):
        if part == "0":
            x = meshio.read(file).points
        if part != "2":
            continue
        mesh = meshio.read(file)
        edges = np.diff(mesh.points[mesh.cells[0].data], axis=1)[:, 0]
        number = sheared.t.tolist().index(t)
        cell = float(sheared.depth) * np.eye(3)
        cell[:2, :2] = sheared.cell[number]
        cell[0, 1] -= cell[0, 0] * np.round(cell[0, 1] / cell[0, 0])
        assert len(edges) == 12
        for vector in cell.T:
            assert np.sum(np.linalg.norm(edges - vector, axis=1) < 1e-9) == 4
        fractions = np.linalg.solve(cell, (x - mesh.points[0]).T)
        assert fractions.min() > -1e-9
        assert fractions.max() < 1 + 1e-9
        leans.append(cell[0, 1] / cell[0, 0])
    assert max(leans) > 0.1
    assert min(leans) < -0.1


def test_the_command_line_writes_them_beside_the_result(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert main(["run", "line", "-o", str(tmp_path / "a.gsd")]) == 0
    assert f"wrote {tmp_path / 'a.npz'} and {tmp_path / 'a.gsd'}" in capsys.readouterr().out
    result = load_particles(tmp_path / "a.npz")
    assert main(["convert", str(tmp_path / "a.npz"), "-o", str(tmp_path / "b.gsd")]) == 0
    with gsd.hoomd.open(str(tmp_path / "a.gsd")) as one, gsd.hoomd.open(str(tmp_path / "b.gsd")) as other:
        assert len(one) == len(other) == len(result)
        assert np.array_equal(one[7].particles.position, other[7].particles.position)
    assert main(["convert", str(tmp_path / "a.npz"), "-o", str(tmp_path / "b.pvd")]) == 0
    assert len(files_of(tmp_path / "b.pvd")) == 2 * len(result)
    # a folder that is called as a stock scene does not hide it
    (tmp_path / "line").mkdir()
    monkeypatch.chdir(tmp_path)
    assert main(["run", "line"]) == 0
    assert main(["convert", str(tmp_path / "a.npz"), "-o", str(tmp_path / "b.xyz")]) == 2
    assert "the ending must be one of .npz, .gsd, .pvd, .csv, .nc" in capsys.readouterr().err


def test_a_run_of_two_particles_is_for_neither(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Neither as it is run nor later; and the files of others are not read back."""
    scene = tmp_path / "pair.toml"
    scene.write_text(
        "law = 'rognon_gay'\n[parameters]\nR = 1.0\nE = 1.0\neta = 1.0\n[pair]\nh = 1.0\n[drive]\nforce = 1e-2\n"
        "[until]\nh = 0.1\n"
    )
    assert main(["run", str(scene), "-o", str(tmp_path / "a.npz")]) == 0
    for command in (["run", str(scene)], ["convert", str(tmp_path / "a.npz")]):
        capsys.readouterr()
        assert main([*command, "-o", str(tmp_path / "a.gsd")]) == 2
        words = capsys.readouterr().err
        assert "of a run of two particles the ending must be one of .json, .npz, .csv, .nc; .gsd and .pvd" in words
    assert main(["plot", str(tmp_path / "a.gsd")]) == 2
    assert ".gsd and .pvd what other programs show" in capsys.readouterr().err


@pytest.mark.parametrize(("suffix", "package"), [(".gsd", "gsd"), (".pvd", "pyevtk")])
def test_a_missing_package_is_named_before_the_run(
    suffix: str, package: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in [name for name in sys.modules if name.partition(".")[0] == package]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, package, None)
    ran: list[Any] = []
    monkeypatch.setattr("softdyn.particles.command.simulate_particles", lambda *given: ran.append(given))
    assert main(["run", "line", "-o", str(tmp_path / f"a{suffix}")]) == 2
    words = capsys.readouterr().err
    assert f"needs the package {package}: pip install 'softdyn[formats]'" in words
    assert not ran
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("ending", "package"), [(".nc", "xarray"), (".csv", "pandas")])
def test_a_missing_table_package_is_named_before_any_run(
    ending: str, package: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, package, None)
    output = tmp_path / f"a{ending}"
    # of two particles .csv needs nothing
    for scene in ["two", "darcy"] if ending == ".csv" else ["two", "darcy", "pair.toml"]:
        if scene == "pair.toml":
            (tmp_path / scene).write_text(
                "law = 'rognon_gay'\nparameters = {R = 1.0, E = 1.0, eta = 1.0}\npair.h = 1.0\ndrive.force = 1e-2\n"
                "until.h = 0.1\n"
            )
        assert main(["run", str(tmp_path / scene) if "." in scene else scene, "-o", str(output)]) == 2
        words = capsys.readouterr()
        assert f"needs the package {package}: pip install 'softdyn[data]'" in words.err
        assert not words.out
    assert not list(tmp_path.glob("a*"))


def test_an_unwritable_place_is_named(sheared: ParticleResult, tmp_path: Path) -> None:
    (tmp_path / "a").write_text("a file where the folder of the frames would be")
    with pytest.raises(SceneError, match="cannot write the folder"):
        sheared.save(tmp_path / "a.pvd")
    (tmp_path / "b.gsd").mkdir()
    with pytest.raises(SceneError, match="cannot write"):
        sheared.save(tmp_path / "b.gsd")


@pytest.mark.parametrize("there", ["nothing", "an earlier export", "a file in the way"])
def test_a_pvd_that_fails_leaves_nothing_behind(
    there: str, sheared: ParticleResult, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Neither frames nor a folder; what an earlier export wrote is still whole."""
    import pyevtk.hl

    if there == "an earlier export":
        sheared.save(tmp_path / "a.pvd")
    elif there == "a file in the way":
        (tmp_path / "a").write_text("mine")
    before = {path: path.read_bytes() for path in sorted(tmp_path.rglob("*")) if path.is_file()}
    if there != "a file in the way":
        write, calls = pyevtk.hl.pointsToVTK, iter(range(100))

        def full(*arguments: Any, **more: Any) -> str:
            if next(calls) == 1:
                raise OSError(28, "No space left on device")
            return str(write(*arguments, **more))

        monkeypatch.setattr(pyevtk.hl, "pointsToVTK", full)
    with pytest.raises(SceneError, match=r"cannot write .*(a.pvd: No space left|a: it is a file)"):
        sheared.save(tmp_path / "a.pvd")
    assert {path: path.read_bytes() for path in sorted(tmp_path.rglob("*")) if path.is_file()} == before
    assert there == "an earlier export" or not (tmp_path / "a").is_dir()
