"""The wheel and the source distribution hold what the tree holds, and work away from it."""

import os
import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path

import pytest

from softdyn.laws import stock_laws

ROOT = Path(__file__).parent.parent
FOLDERS = {
    "softdyn": "softdyn",
    "derive": "softdyn/derive",
    "templates": "softdyn/templates",
}


def tree() -> set[str]:
    """Files of the tree, by the names that they have in an installation."""
    found = set()
    for folder, installed in FOLDERS.items():
        for path in (ROOT / folder).rglob("*"):
            inside = path.relative_to(ROOT / folder)
            linked = folder == "softdyn" and inside.parts[0] in FOLDERS
            if path.is_file() and "__pycache__" not in inside.parts and not linked:
                found.add(f"{installed}/{inside.as_posix()}")
    return found


@pytest.fixture(scope="module")
def distributions(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    out = tmp_path_factory.mktemp("dist")
    command = [sys.executable, "-m", "build", "--outdir", str(out), str(ROOT)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return next(out.glob("*.whl")), next(out.glob("*.tar.gz"))


def test_every_folder_of_modules_is_a_package_that_is_named() -> None:
    """What pyproject.toml does not name is missing from the wheel alone, where nobody looks."""
    named = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]["packages"]
    folders = {str(Path(file).parent).replace("/", ".") for file in tree() if file.endswith((".py", ".j2"))}
    assert {f for f in folders if not f.startswith("softdyn.templates.")} <= set(named)


@pytest.mark.slow
def test_the_wheel_holds_the_tree(distributions: tuple[Path, Path]) -> None:
    """The wheel is built from the source distribution, so this holds for both."""
    with zipfile.ZipFile(distributions[0]) as wheel:
        packed = {name for name in wheel.namelist() if ".dist-info/" not in name}
    assert packed == tree()


@pytest.mark.slow
def test_the_source_distribution_holds_the_licence_and_the_readme(distributions: tuple[Path, Path]) -> None:
    with tarfile.open(distributions[1]) as source:
        names = {name.split("/", 1)[1] for name in source.getnames() if "/" in name}
    assert {"LICENSE", "README.md", "pyproject.toml", "derive/law.py", "templates/common/pair.py.j2"} <= names


@pytest.mark.slow
def test_the_wheel_works_outside_the_checkout(distributions: tuple[Path, Path], tmp_path: Path) -> None:
    """Dependencies are this environment's; softdyn itself comes from the wheel."""
    site = tmp_path / "site"
    pip = [
        sys.executable,
        "-m",
        "pip",
        "install",
        "--no-deps",
        "--no-index",
        "--target",
        str(site),
        str(distributions[0]),
    ]
    subprocess.run(pip, capture_output=True, check=True)
    code = (
        "import softdyn, softdyn.derive; print(softdyn.__file__, softdyn.derive.__file__);"
        "r = softdyn.simulate(law='rognon_gay', parameters=dict(R=1, E=1, eta=1), h=100, force=1e-2, until_h=1e-3);"
        "print(r.t[-1])"
    )
    environment = {**os.environ, "PYTHONPATH": str(site), "SOFTDYN_CACHE_DIR": str(tmp_path / "cache")}
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    files, t = done.stdout.splitlines()
    assert all(Path(file).is_relative_to(site) for file in files.split())
    assert float(t) == pytest.approx(4168622.0766990120018, rel=1e-8)


@pytest.mark.slow
def test_a_checkout_without_symbolic_links_works(tmp_path: Path) -> None:
    """As Git for Windows makes it: the links in softdyn/ are then files that hold a path.

    What runs in the folder above finds softdyn, though that folder holds one of this name.
    """
    checkout, environment = tmp_path / "softdyn", tmp_path / "environment"
    subprocess.run(
        ["git", "-c", "core.symlinks=false", "clone", "-q", str(ROOT), str(checkout)], capture_output=True, check=True
    )
    assert not (checkout / "softdyn" / "derive").is_symlink()
    subprocess.run([sys.executable, "-m", "venv", str(environment)], check=True)
    python = environment / "bin" / "python"
    site = next((environment / "lib").glob("python3*/site-packages"))
    # dependencies are this environment's
    (site / "dependencies.pth").write_text("\n".join(path for path in sys.path if "site-packages" in path))
    subprocess.run([python, "-m", "pip", "install", "--no-deps", "-e", str(checkout)], capture_output=True, check=True)
    code = (
        "import softdyn, softdyn.laws, softdyn.stock, softdyn.stress.precise_pairs, softdyn.kernels;"
        "print(softdyn.__file__);"
        "print(len(softdyn.laws.stock_laws()), softdyn.stock.GENERATED.is_dir(),"
        " softdyn.stress.precise_pairs.FILE.is_file());"
        "parameters = dict(R=1, E=1, eta=1);"
        "r = softdyn.simulate(law='rognon_gay', parameters=parameters, h=100, force=1e-2, until_h=1e-3);"
        "print(r.t[-1])"
    )
    variables = {**os.environ, "SOFTDYN_CACHE_DIR": str(tmp_path / "cache")}
    done = subprocess.run(
        [python, "-c", code], cwd=tmp_path, env=variables, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    file, found, t = done.stdout.splitlines()
    assert Path(file).is_relative_to(checkout)
    assert found == f"{len(stock_laws())} True True"
    assert float(t) == pytest.approx(4168622.0766990120018, rel=1e-8)


@pytest.mark.parametrize("here", ["a folder of that name", "a package of that name", "nothing"])
def test_a_folder_of_that_name_does_not_hide_softdyn(here: str, tmp_path: Path) -> None:
    """A package of that name does, as any script does beside it."""
    if here != "nothing":
        (tmp_path / "softdyn").mkdir()
    if here == "a package of that name":
        (tmp_path / "softdyn" / "__init__.py").write_text("")
    own = here != "a package of that name"
    code = (
        f"text = open({str(ROOT / 'softdyn' / 'in_place.py')!r}).read(); finder = {{'__name__': 'softdyn_in_place'}};"
        "exec(text, finder); finder['install'](); finder['install']();"
        f"import softdyn; assert hasattr(softdyn, 'simulate') is {own}, softdyn"
    )
    done = subprocess.run([sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr


def test_derive_is_refused_under_another_name(tmp_path: Path) -> None:
    """Two copies of one module would not recognise each other's laws."""
    done = subprocess.run(
        [sys.executable, "-c", "import derive"], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.returncode == 1
    assert "import this package as softdyn.derive" in done.stderr


def test_the_versions_agree() -> None:
    import softdyn

    assert tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"] == softdyn.__version__
