"""`make crate`: scenes, code, environment, figures and claims as a Workflow Run RO-Crate, in `paper_figures/out/crate`.

The crate is a copy of the checkout with the figures of `make figures` and `ro-crate-metadata.json`. The metadata list
every file with its size and SHA-256, the workflow (`python -m paper_figures`) with its inputs (scenes) and outputs
(figures), the action that produced them, and the action that judged the claims.
PROFILES lists the profiles to which the crate conforms.
"""

from __future__ import annotations

import hashlib
import json
import mimetypes
import shutil
import sys
from collections.abc import Iterable
from datetime import UTC, datetime
from importlib import import_module
from importlib.metadata import version
from pathlib import Path

from paper_figures import FIGURES, manifest
from repro.runs.machine import source_hash

ROOT = Path(__file__).parents[1]
METADATA = "ro-crate-metadata.json"
#: Contents of the crate besides the figures: folders, without generated files, and files.
FOLDERS = ("docs", "paper_figures", "reference", "repro", "tests", "verification")
FILES = ("CHANGELOG.md", "CITATION.cff", "CONTRIBUTING.md", "LICENSE", "MANIFEST.in", "Makefile", "README.md",
         "codecheck.yml", "pyproject.toml", "requirements.lock")
GENERATED = {"__pycache__", "out", "cache", "live", "pictures"}
NAME = "dupin2001-repro"
WORKFLOW = "paper_figures/__main__.py"
JUDGE = "verification/claims/__main__.py"
ENVIRONMENT = ("pyproject.toml", "requirements.lock")
CLAIMS = ("paper_figures/replication.md", "paper_figures/register.md", "verification/claims/claims.json")
PAPER = "https://doi.org/10.1029/2001WR000306"
LICENSE = "https://spdx.org/licenses/BSD-3-Clause"
BIOSCHEMAS = "https://bioschemas.org/profiles"
PROFILES = {"https://w3id.org/ro/wfrun/process/0.5": "Process Run Crate",
            "https://w3id.org/ro/wfrun/workflow/0.5": "Workflow Run Crate",
            "https://w3id.org/workflowhub/workflow-ro-crate/1.0": "Workflow RO-Crate"}
CONTEXT = ["https://w3id.org/ro/crate/1.1/context", {"sha256": "https://w3id.org/ro/terms/workflow-run#sha256"}]
TYPES = {".py": "text/x-python", ".toml": "application/toml", ".md": "text/markdown", ".lock": "text/plain",
         ".cff": "application/yaml", ".yml": "application/yaml"}

Entity = dict[str, object]


def main() -> int:
    """Write the crate; return 2 if there are no figures of the present source."""
    try:
        written = write(manifest.OUT, manifest.OUT / "crate")
    except FileNotFoundError as error:
        print(f"crate: {error}", file=sys.stderr)
        return 2
    print(f"{written}: {len(json.loads((written / METADATA).read_text())['@graph'])} entities")
    return 0


def write(out: Path, crate: Path) -> Path:
    """Write the crate from the checkout and the figures in `out`. Raises FileNotFoundError if figures are
    missing or were drawn by another source."""
    pictures = figures(out)
    temporary = crate.with_name(f".part-{crate.name}")
    shutil.rmtree(temporary, ignore_errors=True)
    contents = {path.relative_to(ROOT).as_posix(): path for path in checkout()}
    contents |= {_path_in_crate(path): path for path in [*sum(pictures.values(), []), out / manifest.NAME]}
    for name, path in contents.items():
        (temporary / name).parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(path, temporary / name)
    ended = datetime.fromtimestamp((out / manifest.NAME).stat().st_mtime, UTC)
    pictures_in_crate = {name: list(map(_path_in_crate, paths)) for name, paths in pictures.items()}
    entities = graph(temporary, sorted(contents), pictures_in_crate, ended.isoformat(timespec="seconds"))
    metadata = {"@context": CONTEXT, "@graph": entities}
    (temporary / METADATA).write_text(json.dumps(metadata, indent=1) + "\n", encoding="utf-8")
    shutil.rmtree(crate, ignore_errors=True)
    temporary.rename(crate)
    return crate


def _path_in_crate(path: Path) -> str:
    """Path in the crate of an output of `make figures`."""
    return f"paper_figures/out/{path.name}"


def checkout() -> list[Path]:
    """The files of the checkout that are not generated."""
    inner = [path for folder in FOLDERS for path in (ROOT / folder).rglob("*")]
    files = [path for path in inner if path.is_file() and not GENERATED.intersection(path.relative_to(ROOT).parts)
            and path.suffix != ".html"]
    return [*files, *(ROOT / name for name in FILES)]


def figures(out: Path) -> dict[str, list[Path]]:
    """The pictures of each figure. Raises FileNotFoundError like :func:`write`."""
    hint = "`make figures` makes them"
    if not (out / manifest.NAME).is_file():
        raise FileNotFoundError(f"{out / manifest.NAME}: there are no figures; {hint}")
    record = json.loads((out / manifest.NAME).read_text(encoding="utf-8"))
    if record["environment"]["source"] != source_hash():
        raise FileNotFoundError(f"{out / manifest.NAME}: the figures are those of another source; {hint} anew")
    pictures = {name: list(map(out.joinpath, sorted(record["figures"][name]["pictures"]))) for name in FIGURES}
    for path in sum(pictures.values(), []):
        if not path.is_file():
            raise FileNotFoundError(f"{path}: a figure is missing; {hint} anew")
    return pictures


def graph(crate: Path, names: list[str], pictures: dict[str, list[str]], ended: str) -> list[Entity]:
    """Every entity of the crate; `names` are its files, `pictures` those of each figure."""
    modules = {name: import_module(f"paper_figures.{name}") for name in FIGURES}
    scene_names = {request.scene for module in modules.values() for request in module.RUNS}
    scenes = [f"repro/scene/packaged/{name}.toml" for name in sorted(scene_names)]
    inputs = {_id("input", Path(name).stem): [name] for name in scenes}
    outputs = {_id("output", name): paths for name, paths in pictures.items()}
    files = {name: _file(crate, name) for name in names}
    for parameter, examples in (inputs | outputs).items():
        for name in examples:
            files[name]["exampleOfWork"] = {"@id": parameter}
    files[WORKFLOW] |= _program("The figures of the paper", "ComputationalWorkflow") | {
        "input": _refer(inputs), "output": _refer(outputs),
        "conformsTo": {"@id": f"{BIOSCHEMAS}/ComputationalWorkflow/1.0-RELEASE"}}
    files[JUDGE] |= _program("The paper's statements, judged")
    drawn = [*sum(pictures.values(), []), _path_in_crate(manifest.OUT / manifest.NAME)]
    actions = [_action("#figures", "make figures", "Run the scenes and draw the figures of the paper", WORKFLOW,
                       [*scenes, *ENVIRONMENT], drawn) | {"endTime": ended},
               _action("#claims", "make claims", "Judge the statements of the paper by computed numbers", JUDGE,
                       [*scenes, *ENVIRONMENT], CLAIMS)]
    return [_metadata(), _root(names, ended), *_folders(names), *files.values(), *actions,
            *(_parameter(name, examples) for name, examples in (inputs | outputs).items()), *_context()]


def _id(kind: str, name: str) -> str:
    return f"#{kind}-{name}"


def _refer(names: Iterable[str]) -> Entity | list[Entity]:
    """A list of references, or a single reference without a list."""
    references: list[Entity] = [{"@id": name} for name in names]
    return references[0] if len(references) == 1 else references


def _metadata() -> Entity:
    profiles = ["https://w3id.org/ro/crate/1.1", "https://w3id.org/workflowhub/workflow-ro-crate/1.0"]
    return {"@id": METADATA, "@type": "CreativeWork", "about": {"@id": "./"}, "conformsTo": _refer(profiles)}


def _root(names: list[str], published: str) -> Entity:
    top = [name for name in names if "/" not in name]
    return {"@id": "./", "@type": "Dataset", "name": f"{NAME} {version(NAME)}",
            "description": "A reproduction of Dupin, Kitanidis & McCarty (2001): the code, its scenes and environment, "
                           "the figures drawn from runs of these, and the verdicts on the paper's statements",
            "datePublished": published, "license": {"@id": LICENSE}, "author": {"@id": "#authors"},
            "publisher": {"@id": "#authors"}, "citation": {"@id": PAPER}, "conformsTo": _refer(PROFILES),
            "hasPart": _refer([*(f"{folder}/" for folder in FOLDERS), *top]), "mainEntity": {"@id": WORKFLOW},
            "mentions": _refer(["#figures", "#claims"])}


def _folders(names: list[str]) -> list[Entity]:
    about = {"docs": "Documentation", "paper_figures": "The figures and their code",
             "reference": "References that do not use the solver", "repro": "The solver", "tests": "The tests",
             "verification": "Verification cases, claims and benchmarks"}
    entities: list[Entity] = []
    for folder in FOLDERS:
        inside = _refer(name for name in names if name.startswith(f"{folder}/"))
        entities.append({"@id": f"{folder}/", "@type": "Dataset", "name": folder, "description": about[folder],
                      "hasPart": inside})
    return entities


def _file(crate: Path, name: str) -> Entity:
    content = (crate / name).read_bytes()
    kind = TYPES.get(Path(name).suffix) or mimetypes.guess_type(name)[0] or "text/plain"
    return {"@id": name, "@type": "File", "name": name, "contentSize": str(len(content)), "encodingFormat": kind,
            "sha256": hashlib.sha256(content).hexdigest()}


def _program(name: str, *kinds: str) -> Entity:
    return {"@type": ["File", "SoftwareSourceCode", *kinds], "name": name, "version": version(NAME),
            "programmingLanguage": {"@id": "#python"}, "license": {"@id": LICENSE}, "creator": {"@id": "#authors"}}


def _action(name: str, words: str, description: str, instrument: str, inputs: Iterable[str],
            outputs: Iterable[str]) -> Entity:
    return {"@id": name, "@type": "CreateAction", "name": words, "description": description,
            "instrument": {"@id": instrument}, "agent": {"@id": "#authors"}, "object": _refer(inputs),
            "result": _refer(outputs), "actionStatus": "http://schema.org/CompletedActionStatus"}


def _parameter(name: str, examples: list[str]) -> Entity:
    return {"@id": name, "@type": "FormalParameter", "name": name.partition("-")[2], "additionalType": "File",
            "description": "a scene" if name.startswith("#input") else "the pictures of a figure",
            "valueRequired": name.startswith("#input"), "workExample": _refer(examples),
            "conformsTo": {"@id": f"{BIOSCHEMAS}/FormalParameter/1.0-RELEASE"}}


def _context() -> list[Entity]:
    """Entities outside the crate to which the others refer."""
    profiles = [{"@id": address, "@type": "CreativeWork", "name": words, "version": address.rpartition("/")[2]}
                for address, words in PROFILES.items()]
    shapes = [{"@id": f"{BIOSCHEMAS}/{kind}/1.0-RELEASE", "@type": "CreativeWork", "name": f"Bioschemas {kind}",
               "version": "1.0-RELEASE"} for kind in ("ComputationalWorkflow", "FormalParameter")]
    python = {"@id": "#python", "@type": "ComputerLanguage", "name": "Python", "url": {"@id": "https://www.python.org"},
              "version": manifest.environment()["python"]}
    return [*profiles, *shapes, python,
            {"@id": "#authors", "@type": "Organization", "name": f"the {NAME} authors"},
            {"@id": LICENSE, "@type": "CreativeWork", "name": "BSD-3-Clause",
             "description": "The 3-clause BSD licence"},
            {"@id": PAPER, "@type": "ScholarlyArticle", "name":
             "Pore-scale modeling of biological clogging due to aggregate expansion: A material mechanics approach"}]


if __name__ == "__main__":
    sys.exit(main())
