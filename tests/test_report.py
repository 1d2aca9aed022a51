"""The page on a law: whole, self-contained, safe, the same every time, and readable in a browser."""

import re
import shutil
import subprocess
import sys
from dataclasses import replace
from html.parser import HTMLParser
from importlib import import_module
from importlib.resources import files
from itertools import pairwise
from pathlib import Path

import pytest
from sympy import pi, sin, sqrt, sstr

from softdyn.derive import ContactLaw, Limit, R, delta, eta, h
from softdyn.derive.kernel_form import total_operations
from softdyn.derive.law import expressions, law_hash
from softdyn.derive.law_dynamics import law_quantities
from softdyn.derive.limits import check_limits
from softdyn.derive.pair_kernel import kernel_ir
from softdyn.derive.regimes import discover
from softdyn.derive.typeset import findings_html, to_latex
from softdyn.errors import SceneError
from softdyn.laws import find, load, stock_closures, stock_laws
from softdyn.mathtext import displayed
from softdyn.study.findings_text import limits_text
from softdyn.study.formulas import cut, formula, pieces, widest
from softdyn.study.law_page import SCENES, decimal, film, page, write_report

VOID = {"meta", "br", "img", "wbr", "link", "input", "hr"}
HOSTILE = "<script>alert('x')</script> & \"quoted\" </style> {{ 7*7 }}"


class Page(HTMLParser):
    """What a test asks of a page; it must be well-formed."""

    def __init__(self, text: str) -> None:
        super().__init__(convert_charrefs=True)
        self.open: list[str] = []
        self.tags: list[tuple[str, dict[str, str]]] = []
        self.words = ""
        self.feed(text)
        self.close()
        assert not self.open, f"never closed: {self.open}"

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        names = [name for name, _ in attrs]
        assert len(names) == len(set(names)), f"{tag} has an attribute twice"
        self.tags.append((tag, {name: value or "" for name, value in attrs}))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        assert "math" in self.open, f"<{tag}/> is no HTML"
        self.tags.append((tag, {name: value or "" for name, value in attrs}))

    def handle_endtag(self, tag: str) -> None:
        assert self.open, f"</{tag}> closes nothing"
        assert self.open.pop() == tag, f"</{tag}> is out of order"

    def handle_data(self, data: str) -> None:
        if "style" not in self.open:
            self.words += data

    def all(self, tag: str) -> list[dict[str, str]]:
        return [attributes for name, attributes in self.tags if name == tag]

    def each(self, attribute: str) -> list[str]:
        return [attributes[attribute] for _, attributes in self.tags if attribute in attributes]


@pytest.fixture(scope="module")
def law() -> ContactLaw:
    """The paper's law, with hostile words, a wrong claim and one that cannot be decided."""
    paper = load(find("rognon_gay"))[0]
    wrong = Limit(
        HOSTILE,
        order=(delta, h, R),
        claims={"zeta": 12 * pi * eta * R**2 / h, "a": sqrt(2 * R * h) * (1 + h / R * sin(R / h))},
    )
    return replace(paper, description=HOSTILE, source=HOSTILE, limits=(*paper.limits, wrong))


@pytest.fixture(scope="module")
def text(law: ContactLaw) -> str:
    return page(law)


@pytest.fixture(scope="module")
def parsed(text: str) -> Page:
    return Page(text)


# -------------------------------------------------------------------------------------------------------- the page


@pytest.mark.slow
def test_the_page_is_well_formed_and_says_its_language(parsed: Page, text: str) -> None:
    assert text.startswith("<!doctype html>")
    assert parsed.all("html") == [{"lang": "en"}]
    assert parsed.all("meta")[0] == {"charset": "utf-8"}
    identifiers = parsed.each("id")
    assert len(identifiers) == len(set(identifiers))


def test_headings_descend_one_level_at_a_time(parsed: Page) -> None:
    levels = [int(tag[1]) for tag, _ in parsed.tags if re.fullmatch("h[1-6]", tag)]
    assert levels[0] == 1
    assert levels.count(1) == 1
    assert all(below <= above + 1 for above, below in pairwise(levels))


def test_nothing_is_loaded_from_elsewhere_and_nothing_runs(parsed: Page, text: str) -> None:
    tags = {tag for tag, _ in parsed.tags}
    assert not tags & {"script", "link", "iframe", "object", "embed", "base", "form"}
    assert all(source.startswith("data:image/svg+xml;base64,") for source in parsed.each("src"))
    for tag, attributes in parsed.tags:
        assert not [name for name in attributes if name.startswith("on")]
        if "href" in attributes:
            assert attributes["href"].startswith("#") or tag == "a"
    (style,) = re.findall(r"<style>(.*?)</style>", text, re.DOTALL)
    assert set(re.findall(r"url\((.{0,23})", style)) == {"data:font/woff2;base64,"}
    assert "@import" not in style


def test_what_the_author_wrote_is_words(parsed: Page, text: str) -> None:
    assert "<script" not in text
    assert "{{ 7*7 }}" in parsed.words, "templates in words are not filled in"
    assert parsed.words.count(HOSTILE) >= 4, "description, source twice, the limit's name"


def test_pictures_and_formulas_are_described(parsed: Page) -> None:
    assert len(parsed.all("img")) == 3
    assert all(image["alt"] for image in parsed.all("img"))
    formulas = [attributes for _, attributes in parsed.tags if attributes.get("class") == "formula"]
    assert len(formulas) > 100
    assert all(attributes["aria-label"] for attributes in formulas)
    assert all(cell.get("scope") in ("col", "row") for cell in parsed.all("th"))


def test_formulas_are_text_and_no_pictures(parsed: Page, text: str) -> None:
    """What is selected can be copied, and a page of 237 formulas is less than half of what it was with outlines."""
    formulas = [attributes for _, attributes in parsed.tags if attributes.get("class") == "formula"]
    assert all(attributes["role"] == "math" for attributes in formulas)
    assert len(parsed.all("math")) > len(formulas), "in pieces"
    assert not parsed.all("svg")
    words = "".join(part for part in parsed.words.split())
    assert "˙h=Fadh−Fextζ" in words.replace("h˙", "˙h")


# ------------------------------------------------------------------------------------------------ what stands in it


def labels(parsed: Page) -> str:
    return "\n".join(parsed.each("aria-label"))


def test_the_declaration_and_the_derivation_are_there(law: ContactLaw, parsed: Page) -> None:
    spoken = parsed.each("aria-label")
    for expr in expressions(law).values():
        assert sstr(expr) in spoken
    for equation in (
        "F = F_adh - dh_dt*zeta",  # eq. 1
        "X = 2*R - 2*delta + h",  # eq. 2
        "dh_dt = (-F + F_adh)/zeta",  # eq. 7
        "dX_dt = -(F - F_adh)/D - dF_dt/C",  # eq. 9
    ):
        assert equation in spoken
    for name in ("C", "D", "dh_dt", "dX_dt", "lambda1", "lambda2"):
        assert [label for label in spoken if label.startswith(f"{name} = ")], name


def test_every_claim_has_its_verdict(law: ContactLaw, parsed: Page) -> None:
    findings = check_limits(law)
    verdicts = [c["class"].split()[1] for c in parsed.all("span") if c.get("class", "").startswith("verdict ")]
    assert verdicts == [finding.verdict for finding in findings]
    assert set(verdicts) == {"proved", "disproved", "undecided"}
    for finding in findings:
        assert finding.limit in parsed.words
        assert f"{finding.quantity} ~ {sstr(finding.claimed)}" in parsed.each("aria-label")
        if finding.verdict != "proved":
            assert finding.reason[1:] in parsed.words
        for whole, term in finding.chain:
            assert f"{sstr(whole)} -> {sstr(term)}" in parsed.each("aria-label")
        for _, deviation in finding.certificate:
            assert decimal(deviation) in parsed.words


def test_every_regime_has_its_forms_and_exponents(law: ContactLaw, parsed: Page) -> None:
    diagram = discover(law)
    spoken = labels(parsed)
    for regime in diagram.regimes:
        assert regime.name in parsed.words
    for regime in (regime for regime in diagram.regimes if regime.side == "compression"):
        for name, form in regime.forms.items():
            assert f"{name} ~ {sstr(form.leading)}" in spoken
            assert all(f"({sstr(term)})" in spoken for term in form.corrections)
        for condition in regime.conditions:
            assert f"{sstr(condition.small)} << {sstr(condition.large)}" in spoken
    for crossover in diagram.crossovers:
        assert f"{crossover.line.lhs} = {sstr(crossover.line.rhs)}" in spoken


def test_the_film_stands_against_elastohydrodynamics(law: ContactLaw, parsed: Page) -> None:
    entry = film(law)
    assert entry is not None
    assert entry["source"] in parsed.each("src")
    assert f"off by at most {entry['off']}" in parsed.words
    assert "#elastohydrodynamics" in parsed.each("href")
    assert "its centre goes on closing" in parsed.words


def test_tension_is_told_where_it_differs_and_only_there(parsed: Page) -> None:
    """D and dX/dt differ in tension, and nothing else, in the two regimes where a varies with h."""
    after = parsed.words.split("In tension, where it differs")[1].split("Crossovers")[0]
    assert after.count("friction of the centres") == after.count("rate of the distance") == 2
    assert "stiffness" not in after
    assert "Stokes" not in after


def test_operations_are_those_of_the_kernels(law: ContactLaw, parsed: Page) -> None:
    """The counts of the table are those that the header of each source says."""
    totals = [int(n) for n in re.findall(r"Operations, (\d+) in all:", parsed.words)]
    assert totals == [total_operations(kernel_ir(law, needs)) for needs in SCENES.values()]
    rows = re.findall(r"(?:\d+\n){2,}\d+", parsed.words.split("Operations\n")[1].split("Outputs:")[0])
    counts = [[int(count) for count in row.split()] for row in rows]
    assert [row[-1] for row in counts] == totals
    assert all(sum(row[:-1]) == row[-1] for row in counts), "the parts make up the whole"


def test_the_page_tells_where_it_comes_from(law: ContactLaw, parsed: Page) -> None:
    import sympy

    import softdyn

    assert law_hash(law) in parsed.words
    assert f"softdyn {softdyn.__version__} with sympy {sympy.__version__}" in parsed.words


# ------------------------------------------------------------------------------------------------------- other laws


@pytest.mark.slow
def test_the_page_is_written_whole_or_refused(law: ContactLaw, text: str, tmp_path: Path) -> None:
    path = tmp_path / "new" / "report.html"
    write_report(law, path)
    assert path.read_text(encoding="utf-8") == text, "the same law, the same bytes"
    with pytest.raises(SceneError, match="cannot write"):
        write_report(law, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["rognon_gay", "droplet", "soap_film", "hertz_dry", "lubrication_rigid"])
def test_every_kind_of_stock_law_has_a_page(name: str) -> None:
    written = page(load(find(name))[0])
    assert Page(written).all("h1")
    assert ("elastohydrodynamics" in Page(written).each("id")) == (name in ("rognon_gay", "droplet", "soap_film"))
    # what sympy makes of a division by zero
    assert "zoo" not in written
    assert "nan" not in " ".join(Page(written).each("aria-label"))


@pytest.mark.slow
def test_another_process_writes_the_same_bytes(tmp_path: Path) -> None:
    code = "import sys; from pathlib import Path; import softdyn.study.law_page as r; "
    code += "from softdyn.laws import find, load; r.write_report(load(find('rognon_gay'))[0], Path(sys.argv[1]))"
    for seed in ("1", "2"):
        path = tmp_path / f"{seed}.html"
        subprocess.run([sys.executable, "-c", code, str(path)], check=True, env={"PYTHONHASHSEED": seed})
    assert (tmp_path / "1.html").read_bytes() == (tmp_path / "2.html").read_bytes()


# --------------------------------------------------------------------------------------------------------- formulas


def test_formulas_are_cut_where_a_line_may_end() -> None:
    latex = r"a = \frac{b + c}{d} - \left(e + f\right) \ll g(h, - i)"
    assert cut(latex, ("=", "-", "+", r"\ll")) == [
        "a", r"= \frac{b + c}{d}", r"- \left(e + f\right)", r"\ll g(h, - i)"
    ]  # fmt: skip
    assert cut("-a = -b", ("=", "-")) == ["-a", "= -b"], "a sign belongs to what follows"


def test_a_wide_product_is_cut_between_its_factors() -> None:
    factor = r"\left(R + h\right)^{2}"
    parts = pieces(" ".join([factor] * 20))
    assert len(parts) > 1
    assert widest(factor) == pytest.approx(widest(" ".join([factor] * 20)), rel=0.2)


def test_fractions_are_large_but_in_exponents_and_deep_within_others() -> None:
    assert displayed(r"\frac{a}{\frac{b}{\frac{c}{d}}}") == r"\dfrac{a}{\dfrac{b}{\frac{c}{d}}}"
    assert displayed(r"e^{\frac{a}{b}} \frac{c}{d}") == r"e^{\frac{a}{b}} \dfrac{c}{d}"
    assert displayed(r"\sqrt[3]{\frac{a}{b}}") == r"\sqrt[3]{\dfrac{a}{b}}"


@pytest.mark.parametrize(
    "latex", [r"\begin{cases} a \end{cases}", r"\unknown", "{a", "a}", r"\frac{a}", "a^{b}^{c}", r"\left<a\right>", "%"]
)
def test_what_is_not_known_is_shown_as_text(latex: str) -> None:
    assert formula(latex, "a if x < 1") == '<code class="formula">a if x &lt; 1</code>'
    assert widest(latex) == float("inf")


def mathml(latex: str) -> str:
    return "".join(re.findall(r"<math[^>]*>(.*?)</math>", formula(latex, "?")))


def test_formulas_are_mathml() -> None:
    assert mathml(r"F_\mathrm{ext}") == "<msub><mi>F</mi><mi>ext</mi></msub>"
    assert mathml(r"\dot{h}^{2}") == (
        '<msup><mover accent="true"><mi>h</mi><mo stretchy="false">˙</mo></mover><mn>2</mn></msup>'
    )
    assert mathml(r"\sqrt[3]{\Pi}") == '<mroot><mi mathvariant="normal">Π</mi><mn>3</mn></mroot>'
    bracket = '<mo form="{}" stretchy="true">{}</mo>'
    assert mathml(r"\left(\frac{h}{R}\right)^{-3}") == (
        f"<msup><mrow>{bracket.format('prefix', '(')}<mfrac><mi>h</mi><mi>R</mi></mfrac>"
        f'{bracket.format("postfix", ")")}</mrow><mrow><mo form="prefix">−</mo><mn>3</mn></mrow></msup>'
    )


def test_a_minus_between_two_stands_apart_and_a_sign_does_not() -> None:
    """Also where the formula was cut before it."""
    assert mathml("a - b").count('<mo form="infix">−</mo>') == 1
    assert mathml("-a = -b").count('<mo form="prefix">−</mo>') == 2


def test_fractions_within_one_fraction_are_full_and_within_two_small() -> None:
    assert mathml(r"\frac{a}{\frac{b}{\frac{c}{d}}}").count('<mfrac displaystyle="true">') == 1
    assert "displaystyle" not in mathml(r"e^{\frac{a}{b}}")


def test_widths_are_those_of_a_typesetter_to_a_quarter() -> None:
    """They decide where lines end, no more."""
    from matplotlib import rc_context
    from matplotlib.font_manager import FontProperties
    from matplotlib.textpath import TextToPath

    for latex in (
        r"\frac{2 F_\mathrm{ext}\,R^{3}\,h^{3}}{3 \pi \eta a^{4} \left(R + h\right)^{3}}",
        r"\sqrt{2 R \left(\frac{R h}{R + h} + |\delta|\right)}",
        r"\kappa \left(\frac{h}{R}\right)^{-3/2} e^{-h/\ell} \ln\left(1 + \frac{R}{h}\right)",
    ):
        with rc_context({"mathtext.fontset": "stix"}):
            sizes = TextToPath().get_text_width_height_descent(f"${displayed(latex)}$", FontProperties(size=100), True)
        assert sum(widest(piece) for piece in pieces(latex)) == pytest.approx(sizes[0] / 100, rel=0.25)


def test_what_is_wider_than_paper_is_set_smaller_there() -> None:
    wide = r"\frac{" + "a b " * 60 + "}{c}"
    assert (found := re.search(r"--fit:(0\.\d+)", formula(wide, "?")))
    assert float(found[1]) * widest(wide) == pytest.approx(44, rel=0.02)
    assert "--fit" not in formula(r"\frac{a}{c}", "?")


def test_every_formula_of_the_stock_laws_and_closures_can_be_set() -> None:
    """What they declare, and what follows: none is shown as text."""
    for name in stock_laws():
        law = load(find(name))[0]
        for expr in (*expressions(law).values(), *law_quantities(law).values()):
            assert widest(to_latex(expr)) < float("inf"), expr
    for name in stock_closures():
        closure = import_module(f"softdyn.derive.closures.{name}").closure
        assert widest(to_latex(closure.expression)) < float("inf"), name


def test_the_font_of_formulas_says_its_licence() -> None:
    folder = files("softdyn.templates").joinpath("report")
    assert folder.joinpath("math.woff2").read_bytes()[:4] == b"wOF2"
    assert "SIL OPEN FONT LICENSE" in folder.joinpath("math.txt").read_text(encoding="utf-8")


def test_numbers_are_written_as_by_hand() -> None:
    assert [decimal(x) for x in (1e-30, 3.1e-10, 0.25, -2e8, 1.0)] == ["10⁻³⁰", "3.1·10⁻¹⁰", "0.25", "−2·10⁸", "1"]


# ------------------------------------------------------------------------------------------------------- a browser

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")


@pytest.fixture(scope="module")
def browser() -> str:
    found = next((path for name in BROWSERS if (path := shutil.which(name))), None)
    if found is None:
        pytest.skip("no browser here")
    return found


@pytest.fixture
def measured(browser: str, text: str, tmp_path: Path) -> dict[int, str]:
    """What sticks out, how many pictures are broken and fonts loaded, by the width of the page in a browser."""
    (tmp_path / "page.html").write_text(text, encoding="utf-8")
    script = (
        "<!doctype html><title>?</title>"
        + "".join(f"<iframe src='page.html' style='width:{w}px;height:900px;border:0'></iframe>" for w in (400, 1200))
        + "<script>onload = () => { document.title = [...document.querySelectorAll('iframe')].map(f => {"
        "const d = f.contentDocument.documentElement;"
        "const broken = [...f.contentDocument.images].filter(i => !i.naturalWidth).length;"
        "return [f.clientWidth, d.scrollWidth - d.clientWidth, broken, f.contentDocument.fonts.size].join(':')"
        "}).join(' ') }</script>"
    )
    (tmp_path / "outer.html").write_text(script, encoding="utf-8")
    command = [
        browser, "--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking",
        "--disable-sync", "--allow-file-access-from-files", f"--user-data-dir={tmp_path / 'profile'}",
        "--virtual-time-budget=20000", "--dump-dom", (tmp_path / "outer.html").as_uri(),
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    found = re.search(r"<title>([^<]*)</title>", done.stdout)
    assert found, done.stdout[:500]
    return {int(w): rest for w, _, rest in (entry.partition(":") for entry in found[1].split())}


@pytest.mark.slow
def test_a_browser_shows_it_without_anything_sticking_out(measured: dict[int, str]) -> None:
    """On a phone and on a screen: as wide as the window, no picture broken, no font but that within."""
    assert measured == {400: "0:0:1", 1200: "0:0:1"}


@pytest.mark.slow
def test_a_verdict_says_on_which_set_it_holds_and_a_refuted_one_where_it_fails() -> None:
    """On the page, in the text, and in a notebook."""
    soap_film, _ = load(find("soap_film"))
    poiseuille = soap_film.limits[0]
    # without A exp(-h/ell) << F: it fails where the film still carries the force
    wider = Limit("too wide", poiseuille.order[:2], {"dh_dt": poiseuille.claims["dh_dt"]})
    law = replace(soap_film, limits=(wider,))
    (finding,) = findings = check_limits(law)
    assert finding.verdict == "disproved"
    assert finding.witness is not None
    shown = page(law)
    for text in (limits_text(law.name, findings), findings_html(findings), shown):
        assert "as every inequality of" in text
        assert f"{finding.samples} random path" in text
    assert "A path on which it fails" in shown
    assert all(f"found/claimed = {found}" in shown for _, found in finding.witness.points)
