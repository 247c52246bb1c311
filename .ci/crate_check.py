"""Validate an RO-Crate against Workflow Run Crate 0.5, with what crate.lock pins.

    python .ci/crate_check.py FOLDER [options of rocrate-validator validate]

Nothing is asked of the network: the JSON-LD context is the copy that the package rocrate brings.
"""

import io
import subprocess
import sys
from importlib.resources import files
from pathlib import Path
from tempfile import TemporaryDirectory

from requests import Response
from requests.adapters import BaseAdapter
from requests_cache import CachedSession
from urllib3 import HTTPResponse

CONTEXT = "https://w3id.org/ro/crate/1.1/context"


class Brought(BaseAdapter):
    """Answers with the context."""

    def send(self, request, **_):
        content = files("rocrate").joinpath("data/ro-crate.jsonld").read_bytes()
        found = Response()
        found.status_code = 200
        found.url = request.url
        found.request = request
        found.headers["Content-Type"] = "application/ld+json"
        found.raw = HTTPResponse(io.BytesIO(content), found.headers, 200, preload_content=False)
        return found

    def close(self):
        """Nothing is open."""


def main(crate: str) -> int:
    """The exit status of the validator, which is given further options as they are."""
    with TemporaryDirectory() as folder:
        cache = str(Path(folder) / "context")
        session = CachedSession(cache, backend="sqlite", expire_after=-1)
        session.mount("https://w3id.org/", Brought())
        assert session.get(CONTEXT).json()["@id"] == CONTEXT
        session.close()
        return subprocess.run([str(Path(sys.executable).with_name("rocrate-validator")), "-y", "--disable-color",
                               "validate", "--offline", "--cache-path", cache, "--skip-availability-check",
                               "--profile-identifier", "workflow-run-crate-0.5", "--no-paging", "--verbose",
                               *sys.argv[2:], crate]).returncode


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
