"""The share of firmware/core's lines and branches that the C tests reach; fails below the limits.

``core_coverage.py BUILD`` after ``ctest --preset coverage``; gcov's own JSON is the source.
"""

import json
import subprocess
import sys
from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
CORE = ROOT / "firmware" / "core"
MIN_LINES, MIN_BRANCHES = 95.0, 90.0


class Source:
    """What was reached of one file, over all that include it."""

    def __init__(self) -> None:
        self.lines: dict[int, int] = defaultdict(int)
        self.branches: dict[tuple[int, int], int] = defaultdict(int)

    def reached(self) -> tuple[int, int, int, int]:
        """Lines reached and in all, branches reached and in all."""
        lines, branches = self.lines.values(), self.branches.values()
        return sum(n > 0 for n in lines), len(lines), sum(n > 0 for n in branches), len(branches)


def read(build: Path) -> dict[str, Source]:
    counts = sorted((build / "firmware" / "core").rglob("*.gcda"))
    if not counts:
        sys.exit(f"{build} holds no counts; run ctest --preset coverage first")
    run = subprocess.run(
        ["gcov", "--json-format", "--stdout", "--branch-probabilities", *map(str, counts)],
        cwd=build,
        capture_output=True,
        text=True,
        check=True,
    )
    sources: dict[str, Source] = defaultdict(Source)
    for report in map(json.loads, run.stdout.splitlines()):
        for file in report["files"]:
            path = (Path(report["current_working_directory"]) / file["file"]).resolve()
            if path.parent != CORE:
                continue
            source = sources[path.name]
            for line in file["lines"]:
                source.lines[line["line_number"]] += line["count"]
                for index, branch in enumerate(line["branches"]):
                    source.branches[line["line_number"], index] += branch["count"]
    return sources


def missed(source: Source) -> str:
    lines = [str(line) for line, count in sorted(source.lines.items()) if count == 0]
    branches = sorted({line for (line, _), count in source.branches.items() if count == 0})
    parts = [f"lines {' '.join(lines)}"] if lines else []
    parts += [f"branches {' '.join(map(str, branches))}"] if branches else []
    return "; ".join(parts)


def main() -> int:
    sources = read(Path(sys.argv[1]).resolve())
    total = [0, 0, 0, 0]
    print(f"{'firmware/core':28} {'lines':>12} {'branches':>12}  not reached")
    for name, source in sorted(sources.items()):
        figures = source.reached()
        total = [a + b for a, b in zip(total, figures, strict=True)]
        shares = f"{figures[0]:5} of {figures[1]:3} {figures[2]:5} of {figures[3]:3}"
        print(f"{name:28} {shares}  {missed(source)}".rstrip())
    lines, branches = 100.0 * total[0] / total[1], 100.0 * total[2] / total[3]
    print(
        f"lines {lines:.1f} % ({total[0]} of {total[1]}, at least {MIN_LINES:.0f} %), "
        f"branches {branches:.1f} % ({total[2]} of {total[3]}, at least {MIN_BRANCHES:.0f} %)"
    )
    return 0 if lines >= MIN_LINES and branches >= MIN_BRANCHES else 1


if __name__ == "__main__":
    sys.exit(main())
