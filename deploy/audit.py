"""Audits what is installed: known vulnerabilities, and the licences of what a boat gets.

    python deploy/audit.py            from the environment that is audited (`make audit`)

pip-audit asks the package index, or OSV where that does not know, about every version. Where no
service can be reached nothing is known, and that is said; it is no failure. Exit status 1: a
vulnerability that is not in `deploy/audit-accepted.txt`, or a licence that a boat cannot carry.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
import sysconfig
import venv
from collections.abc import Iterator
from dataclasses import dataclass
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parent.parent
TOOL = ROOT / "build" / "audit"
"""pip-audit's own environment: what it needs is not what we audit."""
REQUIREMENT = "pip-audit>=2.9,<3"
SERVICES = ("pypi", "osv")
ACCEPTED = Path(__file__).with_name("audit-accepted.txt")
COPYLEFT = re.compile(r"(?<!L)\bA?GPL|(?<!Lesser )General Public Licen[sc]e|Affero")
"""Licences that would reach over to the whole boat; the Lesser ones do not."""
NAME = re.compile(r"[A-Za-z0-9._-]+")


@dataclass(frozen=True)
class Answer:
    """What a service knows."""

    service: str
    asked: int
    known: int
    """How many of the packages the service knows."""
    found: tuple[tuple[str, str, str, str], ...]
    """Package, version, identity of the vulnerability, versions that mend it."""


def main() -> int:
    """Audit, and say what was found."""
    bad = list(licences())
    for line in bad:
        print(f"licence: {line}")
    if not bad:
        print(f"licences: {len(list(shipped()))} packages that a boat gets, none is copyleft")
    answer = ask()
    if answer is None or not answer.known:
        print("vulnerabilities: NOT AUDITED, no service could be reached or knew a package")
        return 1 if bad else 0
    accepted = accepted_ones()
    new = [one for one in answer.found if one[2] not in accepted]
    for package, version, identity, mended in new:
        print(f"vulnerability: {package} {version}: {identity}; mended in {mended or 'none yet'}")
    count = f"{len(new)} known, {len(answer.found) - len(new)} accepted"
    print(
        f"vulnerabilities: {count} in {answer.known} of {answer.asked} packages ({answer.service})"
    )
    return 1 if bad or new else 0


def ask() -> Answer | None:
    """Ask one service after another; None if there is none, or no pip-audit."""
    program = _program()
    if program is None:
        return None
    best = None
    for service in SERVICES:
        answer = _ask(program, service)
        if answer is not None and answer.known:
            return answer
        best = best or answer
    return best


def understood(service: str, report: dict[str, Any]) -> Answer:
    """Understand pip-audit's report."""
    packages = report["dependencies"]
    known = [package for package in packages if "skip_reason" not in package]
    found = tuple(
        (package["name"], package["version"], one["id"], ", ".join(one["fix_versions"]))
        for package in known
        for one in package["vulns"]
    )
    return Answer(service, len(packages), len(known), found)


def accepted_ones() -> set[str]:
    """Give the vulnerabilities that somebody looked at: an identity a line, and why after a #."""
    lines = ACCEPTED.read_text(encoding="utf-8").splitlines()
    return {words for line in lines if (words := line.partition("#")[0].strip())}


def licences() -> Iterator[str]:
    """Give what a boat would get under a licence that it cannot carry."""
    for package in shipped():
        licence = licence_of(package)
        if COPYLEFT.search(licence):
            yield f"{package.name} {package.version}: {licence}"


def licence_of(package: Distribution) -> str:
    """Give a package's licence as it says itself, in short."""
    said = package.metadata
    classes = [
        line.rpartition(" :: ")[2]
        for line in said.get_all("Classifier") or ()
        if line.startswith("License ::")
    ]
    words = said.get("License-Expression") or "; ".join(classes) or said.get("License") or "none"
    return words.strip().splitlines()[0]


def shipped(root: str = "twinscrew") -> Iterator[Distribution]:
    """Give everything that a package needs without any extra, each once."""
    waiting, seen = [root], {root}
    while waiting:
        try:
            package = distribution(waiting.pop())
        except PackageNotFoundError:  # for another system, or another Python
            continue
        yield package
        for line in package.requires or ():
            match = NAME.match(line)
            name = re.sub(r"[-_.]+", "-", match[0]).lower() if match else root
            if "extra ==" not in line and name not in seen:
                seen.add(name)
                waiting.append(name)


def _ask(program: Path, service: str) -> Answer | None:
    words = [
        *("--path", sysconfig.get_paths()["purelib"], "--vulnerability-service", service),
        *("--format", "json", "--progress-spinner", "off", "--desc", "off", "--timeout", "15"),
    ]
    done = subprocess.run([str(program), *words], capture_output=True, text=True, check=False)
    try:
        return understood(service, json.loads(done.stdout))
    except json.JSONDecodeError:
        reason = (done.stderr.strip().splitlines() or ["no answer"])[-1]
        print(f"{service}: {reason[:200]}", file=sys.stderr)
        return None


def _program() -> Path | None:
    """Give pip-audit, installed if need be; None where that is not possible."""
    program = TOOL / "bin" / "pip-audit"
    if program.exists():
        return program
    venv.create(TOOL, with_pip=True, clear=True)
    pip = [str(TOOL / "bin" / "pip"), "--disable-pip-version-check", "install", "-q", REQUIREMENT]
    if subprocess.run(pip, capture_output=True, check=False).returncode:
        print(f"{REQUIREMENT} cannot be installed", file=sys.stderr)
        return None
    return program


if __name__ == "__main__":
    sys.exit(main())
