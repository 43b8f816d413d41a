"""`python -m support.practice_robots --effect NAME --seed 3 --out DIR`: one trial on disk."""

from __future__ import annotations

import argparse
from pathlib import Path

from support.practice_robots.effects import CATALOGUE
from support.practice_robots.outside import OUTSIDE
from support.practice_robots.plans import PLAN_KINDS
from support.practice_robots.trial import NULLS, STRENGTH_NAMES, make_trial


def main() -> None:
    names = [*CATALOGUE, *OUTSIDE, *NULLS]
    parser = argparse.ArgumentParser(prog="python -m support.practice_robots", description=__doc__)
    parser.add_argument("--effect", required=True, choices=names, metavar="NAME", help=", ".join(names))
    parser.add_argument("--second", choices=list(CATALOGUE), metavar="NAME", help="a second effect")
    parser.add_argument("--strength", choices=STRENGTH_NAMES, default="full")
    parser.add_argument("--plan", choices=PLAN_KINDS, help="drawn where not given")
    parser.add_argument("--noise", type=float, help="disturbance over quantisation")
    parser.add_argument("--rate", type=float, default=20.0, help="log rows per second")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path, required=True, help="gets recordings/ and answer.json")
    args = parser.parse_args()
    answer = make_trial(
        args.seed,
        args.effect,
        args.strength,
        folder=args.out,
        plan_kind=args.plan,
        second_effect=args.second,
        noise=args.noise,
        rate_hz=args.rate,
    )
    print(f"{args.out}/recordings  plan {answer.plan}  signals {answer.signals}  truth {answer.truth}")
    for hidden in answer.effects:
        values = "  ".join(f"{name} {value:.4g}" for name, value in hidden.parameters.items())
        print(f"{hidden.name}  S {hidden.strength:.2f}  {values}")


if __name__ == "__main__":
    main()
