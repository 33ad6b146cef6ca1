"""Run by the Python of `.venv-crate`: what roc-validator says of the crates that are named, as JSON, without a network.

    .venv-crate/bin/python tests/results/bundle/crate_validator.py CONTEXT.jsonld CRATE...

The one address that it needs is that of the JSON-LD context of RO-Crate 1.1 (CC0), which is answered from the file.
"""

from __future__ import annotations

import io
import json
import sys
import urllib.error
import urllib.request
import urllib.response
from email.message import Message
from pathlib import Path

import requests
from rocrate_validator.services import validate

CONTEXT = "https://w3id.org/ro/crate/1.1/context"
PROFILE = "process-run-crate-0.5"


class Answers(requests.adapters.BaseAdapter):
    """Stands for the network: it knows the context, and nothing else."""

    def __init__(self, context: bytes) -> None:
        super().__init__()
        self._context = context

    def send(self, request, **options):
        response = requests.Response()
        response.request, response.url = request, request.url
        known = request.url.rstrip("/") == CONTEXT
        response.status_code = 200 if known else 404
        response.headers["Content-Type"] = "application/ld+json"
        response._content = self._context if known else b""
        return response

    def close(self) -> None:
        """Nothing is open."""


class UrllibAnswers(urllib.request.HTTPSHandler):
    """The same for what reads JSON-LD, which goes another way."""

    def __init__(self, context: bytes) -> None:
        super().__init__()
        self._context = context

    def https_open(self, request):
        if request.full_url.rstrip("/") != CONTEXT:
            raise urllib.error.URLError(f"there is no network here, not for {request.full_url}, either")
        head = Message()
        head["Content-Type"] = "application/ld+json"
        answer = urllib.response.addinfourl(io.BytesIO(self._context), head, request.full_url, 200)
        answer.msg = "OK"
        return answer

    http_open = https_open


def main() -> None:
    context = Path(sys.argv[1]).read_bytes()
    answers = Answers(context)
    requests.Session.get_adapter = lambda session, url: answers  # whichever session it makes
    urllib.request.install_opener(urllib.request.build_opener(UrllibAnswers(context)))
    found = {}
    for crate in sys.argv[2:]:
        settings = {"profile_identifier": PROFILE, "requirement_severity": "RECOMMENDED", "no_cache": True}
        result = validate({"rocrate_uri": crate, **settings})
        found[crate] = [[issue.severity.name, issue.message] for issue in result.get_issues()]
    json.dump(found, sys.stdout)


if __name__ == "__main__":
    main()
