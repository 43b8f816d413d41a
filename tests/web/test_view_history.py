"""Undo and redo; a drawn path in an address; the plans that can be driven."""

from __future__ import annotations

import pytest

from truing.plan import Kind
from truing.web.path.history import History
from truing.web.path.path_text import cycles_of_text, cycles_text, nodes_of, nodes_text
from truing.web.path.segments import Node
from truing.web.path.trajectory import Cycle
from truing.web.runs.plans import GROUPS, StepSettings, plan_named, plans_of
from truing.web.views.exports import KINDS
from truing.web.views.plan_figure import plan_figure
from truing.web.world.world_map import WorldMap


def test_undo_goes_back_and_redo_forth_until_something_else_is_done():
    history: History[int] = History()
    history.leave(1)
    history.leave(2)
    assert history.undo(3) == 2
    assert history.undo(2) == 1
    assert history.undo(1) is None
    assert history.redo(1) == 2
    history.leave(2)
    assert history.redo(7) is None
    assert history.undo(7) == 2


def test_a_world_is_the_same_after_it_was_frozen():
    world = WorldMap.empty(3.0, 2.0)
    world.paint_room((-1.0, -0.5), (1.0, 0.5), 0.1)
    frozen = world.frozen()
    again = frozen.world()
    assert (again.occupied == world.occupied).all()
    world.clear()
    assert (frozen.world().occupied == again.occupied).all()
    assert world.frozen() != frozen


def test_a_drawn_path_comes_back_from_its_text():
    nodes = [Node(1.0, -0.25, "line"), Node(0.5, 2.0, "arc")]
    assert nodes_of(nodes_text(nodes), 60) == nodes
    cycles = [Cycle(0.2, 0.0)] * 15 + [Cycle(0.25, -0.5)] * 3 + [Cycle(0.0, 0.0, 0.04)]
    assert cycles_of_text(cycles_text(cycles), 3000) == cycles


@pytest.mark.parametrize("text", ["x", "1_2", "1_2_q", "1_2_3_4_5_6", "a_b_c", "0.1_0_1e9"])
def test_another_text_is_no_path(text):
    assert nodes_of(text, 60) == []
    assert cycles_of_text(text, 100) == []


def test_every_plan_of_every_group_can_be_drawn(tmp_path):
    (tmp_path / "own.toml").write_text(
        "[[segment]]\nduration_s = 1.0\ntwist = { v_mps = 0.2, omega_radps = 0.1 }\n"
    )
    for group in ("diagnosis", "paper", "other", "saved"):
        found = plans_of(group, tmp_path, tmp_path)
        assert group in GROUPS
        assert found, group
        for name in found:
            plan = plan_named(group, name, tmp_path, tmp_path)
            assert plan is not None
            assert plan_figure(plan)["panels"], name
    assert plan_named("paper", "diagnosis/chirp", tmp_path, tmp_path) is None
    assert plan_named("saved", "/etc/passwd", tmp_path, tmp_path) is None


def test_a_step_is_that_of_the_command_line():
    plan = StepSettings("effort", 40.0, 2.0, "left", 50.0).plan()
    rest, step, after = plan.segments
    assert (step.kind, step.duration_s, step.a, step.b) == (Kind.EFFORT, 2.0, 0.4, 0.0)
    assert (rest.duration_s, after.duration_s, plan.log_rate_hz) == (1.0, 1.5, 50)
    assert StepSettings("velocity", 0.3).plan().segments[1].kind is Kind.VELOCITY


def test_every_export_is_offered():
    from truing.exporters import exporters

    assert set(KINDS) == set(exporters())
