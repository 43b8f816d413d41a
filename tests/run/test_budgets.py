"""The budgets' tool: it finds what it is there to find."""

from __future__ import annotations

from pathlib import Path

import pytest

import budgets
import stack_depth
from budgets import Budget, compare, read, table
from stack_depth import Function, StackError, deepest, frames, parse

FUNCTIONS = {0x100: "main", 0x120: "deep", 0x140: "shallow", 0x160: "leaf"}
LISTING = """
     100:	push	{r4, r5, lr}
     102:	sub	sp, #20
     104:	bl	120 <deep>
     108:	bl	140 <shallow>
     120:	stmdb	sp!, {r4, r5, r6, r7, lr}
     124:	vpush	{d8-d9}
     128:	beq.n	12c <deep+0xc>
     12a:	bl	160 <leaf>
     140:	push	{r3, lr}
     142:	pop	{r3, lr}
     144:	b.w	120 <deep>
     160:	str.w	lr, [sp, #-8]!
     164:	bx	lr
"""


def own(function: Function) -> int:
    return function.frame


def test_the_deepest_path_is_that_of_pushes_calls_and_tail_calls() -> None:
    found = parse(LISTING, FUNCTIONS)
    assert {f.name: f.frame for f in found.values()} == {"main": 32, "deep": 36, "shallow": 8, "leaf": 8}
    assert deepest(found, 0x100, own) == stack_depth.Depth(32 + 36 + 8, ("main", "deep", "leaf"))
    # A tail call has left its caller's frame.
    assert deepest(found, 0x140, own).size == 36 + 8


def test_recursion_is_named() -> None:
    found = parse(LISTING + "     166:	bl	120 <deep>\n", FUNCTIONS)
    with pytest.raises(StackError, match="recursion: deep -> leaf -> deep"):
        deepest(found, 0x100, own)


@pytest.mark.parametrize("line", ["166:	bx	r3", "166:	mov	pc, r3", "166:	sub.w	sp, sp, r4"])
def test_a_stack_that_cannot_be_told_is_refused(line: str) -> None:
    with pytest.raises(StackError, match="leaf"):
        parse(f"{LISTING}     {line}\n", FUNCTIONS)


def test_an_array_of_a_length_known_at_run_time_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.su").write_text("a.c:1:1:fixed\t16\tstatic\na.c:9:1:grows\t24\tdynamic\n")
    with pytest.raises(StackError, match="grows"):
        frames(tmp_path)


def test_calls_through_the_fault_table_and_the_request_table_are_followed(image: Path) -> None:
    found = stack_depth.Image(image, budgets.BUILD)
    by_name = {function.name: function for function in found.functions.values()}
    called = {found.functions[address].name for address in by_name["supervisor_step"].calls}
    assert {"left_lost", "overspeed", "loop_overrun"} <= called
    called = {found.functions[address].name for address in by_name["requests_answer"].calls}
    assert {"answer_hello", "answer_param_set", "answer_log_read"} <= called
    assert found.compiled() > 0.9 * len(found.functions)


def test_a_change_is_told_in_per_cent_and_a_passed_limit_with_its_reason() -> None:
    before = {("flash", "B"): 1000.0, ("gone", "B"): 5.0}
    rows = [Budget("flash", 1104, "B", 1050, "one sector"), Budget("tick", 10, "us", None, "")]
    changes, passed = compare(rows, before)
    assert changes == [
        "flash: 1 000 -> 1 100 B, +10.0 %",
        "tick: 10 us, new",
        "gone: 5 B, measured no more",
    ]
    assert passed == ["flash: 1 100 B, limit 1 050 (one sector)"]


def test_a_change_below_rounding_is_none() -> None:
    assert compare([Budget("flash", 31_544, "B", None, "")], {("flash", "B"): 31_500.0}) == ([], [])


def test_a_limit_applies_to_the_figure_with_wait_states() -> None:
    tick = Budget("tick", 60, "us", 100, "a tenth of it", waits=101)
    changes, passed = compare([tick], {("tick", "us"): 60.0, ("tick, with wait states", "us"): 90.0})
    assert changes == ["tick, with wait states: 90 -> 101 us, +12.2 %"]
    assert passed == ["tick: 101 us, limit 100 (a tenth of it)"]


def test_the_committed_table_reads_back(tmp_path: Path) -> None:
    committed = read(budgets.TABLE)
    assert len(committed) > 20
    tick = [committed[f"control tick, worst{which}", "us"] for which in ("", budgets.WAITS)]
    assert tick[0] < tick[1] <= 100
    assert read(tmp_path / "none.md") == {}


def test_a_written_table_says_what_was_measured(tmp_path: Path, image: Path, native_library: Path) -> None:
    costs = budgets.measure(image, flash_waits=False)
    rows = [
        *budgets.memory(image, budgets.F405),
        *budgets.times(image, budgets.BUILD, costs, costs),
        *budgets.loads(costs, costs),
    ]
    written = tmp_path / "table.md"
    written.write_text(table(rows, costs, costs))
    assert compare(rows, read(written))[0] == []
    again = budgets.measure(image, flash_waits=False)
    assert again == costs
