"""The MISRA-C:2012 findings in the firmware beside those that ``firmware/MISRA.md`` accounts for.

``misra.py BUILD_DIR`` fails when a rule is violated that the table does not list, or more often than it says;
``misra.py BUILD_DIR --update`` writes the counts of now into the rows that are there. Rule texts are
copyrighted: numbers only.
"""

import re
import subprocess
import sys
from collections import Counter, defaultdict
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
TABLE = ROOT / "firmware" / "MISRA.md"
CORE, SHARED = "firmware/core", "firmware/stm32"
CHIPS = ("firmware/stm32f405", "firmware/stm32g474")
WHOLE_PROGRAM = {"2.3", "2.4", "2.5", "5.7", "5.8", "5.9", "8.7", "8.9"}  # unused, or used by one file alone
SHOWN = 12  # places of a rule, at most
ROW = re.compile(r"^\| (\d+\.\d+) \| (\w+) \| (\d+) \| (\d+) \|", re.MULTILINE)
Counts = dict[str, tuple[int, int]]  # rule -> findings in core, in the drivers of all chips


def run(cache: Path, includes: tuple[str, ...], checked: tuple[str, ...]) -> set[tuple[str, str, str]]:
    """Findings in the checked folders, and in what they include of `firmware`."""
    cache.mkdir(parents=True, exist_ok=True)
    command = ["cppcheck", "--quiet", "--std=c11", "--addon=misra", f"--cppcheck-build-dir={cache}"]
    command += ["--suppress=missingIncludeSystem", "--template={id} {file} {line}"]
    command += [f"-I{folder}" for folder in ("protocol/c", CORE, "firmware/hal", *includes)]
    done = subprocess.run([*command, *checked], cwd=ROOT, capture_output=True, text=True, check=True)
    if "Bailing out" in done.stderr or "Failed to execute" in done.stderr:
        sys.exit(done.stderr)
    found = re.findall(r"^misra-c2012-(\S+) (\S+) (\d+)$", done.stderr, re.MULTILINE)
    return {finding for finding in found if finding[1].startswith((CORE, SHARED))}


def findings(cache: Path) -> list[tuple[str, str, str]]:
    """Rule, file and line of each finding.

    Core and what the chips share are checked together with the first chip. The second one's files are checked
    alone, for what can be said of them without the rest: that would take twice as long.
    """
    first, second = CHIPS
    found = run(cache, (first, SHARED), (CORE, SHARED, first))
    alone = run(cache / "second", (second, SHARED), (second,))
    found |= {finding for finding in alone if finding[0] not in WHOLE_PROGRAM}
    return sorted(found)


def count(found: list[tuple[str, str, str]]) -> Counts:
    core = Counter(rule for rule, file, _ in found if file.startswith(CORE))
    chip = Counter(rule for rule, file, _ in found if not file.startswith(CORE))
    return {rule: (core[rule], chip[rule]) for rule in core | chip}


def update(counts: Counts) -> None:
    def row(match: re.Match[str]) -> str:
        core, chip = counts.get(match[1], (0, 0))
        return f"| {match[1]} | {match[2]} | {core} | {chip} |"

    TABLE.write_text(ROW.sub(row, TABLE.read_text()))


def main() -> int:
    found = findings(Path(sys.argv[1]))
    counts = count(found)
    if not found:
        sys.exit("cppcheck's misra addon reported nothing at all; does it run?")
    if "--update" in sys.argv:
        update(counts)
    listed = {rule: (int(core), int(chip)) for rule, _, core, chip in ROW.findall(TABLE.read_text())}
    where: dict[str, list[str]] = defaultdict(list)
    for rule, file, line in found:
        where[rule].append(f"{file}:{line}")
    failed = False
    for rule, now in sorted(counts.items(), key=lambda item: [int(part) for part in item[0].split(".")]):
        allowed = listed.get(rule)
        if allowed is None or now[0] > allowed[0] or now[1] > allowed[1]:
            failed = True
            reason = "no deviation is listed" if allowed is None else f"{allowed} are accounted for"
            print(f"rule {rule}: {now} findings (core, drivers), {reason}: {' '.join(where[rule][:SHOWN])}")
    print(f"{len(found)} findings of {len(counts)} MISRA-C:2012 rules; firmware/MISRA.md lists {len(listed)}")
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
