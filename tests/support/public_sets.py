"""Public recordings under $TRUING_RECORDINGS/raw, and how a new user would read each by one command."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from truing.studies.real.mrclam import FULL_SPEED_MPS, WHEELBASE_M


@dataclass(frozen=True)
class PublicSet:
    """One set.

    Attributes
    ----------
    files : under raw/.
    options : of `truing import`, beside --out.
    answers : typed where it asks; None: it asks nothing. A line that changes the proposal is followed by
        Enter, which takes it.
    runs : that come out.
    pose : a file of the pose from outside, or empty.
    """

    files: tuple[str, ...]
    runs: int
    answers: str | None = None
    options: tuple[str, ...] = ()
    pose: str = ""

    def paths(self, recordings: Path) -> list[Path]:
        """The files, that of the pose last; docs/howto/public_sets.md says where they come from."""
        return [recordings / "raw" / name for name in (*self.files, *([self.pose] if self.pose else []))]

    def arguments(self, recordings: Path, out: Path) -> list[str]:
        """Of `truing`, to read the set into a folder."""
        paths = self.paths(recordings)
        files = [str(path) for path in paths[: len(self.files)]]
        pose = ["--pose", str(paths[-1])] if self.pose else []
        return ["import", *files, "--out", str(out), *self.options, *pose]


PUBLIC_SETS: dict[str, PublicSet] = {
    "armada2508": PublicSet(("armada2508/data20200509-1153.json.gz",), 4),
    "frc2881": PublicSet(("frc2881/sysid_data20220227-150426.json.gz",), 4),
    "frc5024": PublicSet(("frc5024/MinibotCarpet20200124-1730.json.gz",), 4),
    "frc5024 piperservant": PublicSet(("frc5024/Piperservant20200206-1721.json.gz",), 4),
    "team4099": PublicSet(("team4099/CharacterizationTestOutput.json.gz",), 4),
    "romi": PublicSet(("romi/FRC_20250321_153530.wpilog",), 4),
    "romi table": PublicSet(("romi/romi_sysid.csv",), 4, "\n"),
    "emps": PublicSet(("emps/DATA_EMPS.mat",), 1, "\n"),
    # What effort its modes stand for is written in its author's notes alone.
    "micromouse": PublicSet(("micromouse/encoders3.csv",), 1, "effort = leftMode / 4 * 100 / 255\n\n"),
    "micromouse map": PublicSet(
        ("micromouse/wheelSpeedCalibration5.csv",), 1, "\n", ("--wheel-radius", "0.016")
    ),
    "mrclam": PublicSet(
        ("mrclam/D6_Robot1_Odometry.dat.gz",),
        1,
        "\n",
        ("--wheelbase", str(WHEELBASE_M), "--full-speed", str(FULL_SPEED_MPS)),
        "mrclam/D6_Robot1_Groundtruth.dat.gz",
    ),
    "odrive": PublicSet(
        tuple(f"odrive/{way}{speed}.csv" for way in ("Down", "Up") for speed in ("05", "1", "25", "4")),
        8,
        "\n",
    ),
}
