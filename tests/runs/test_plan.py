"""The plan of a study: wanted runs add up; one that is damaged holds none."""

from pathlib import Path

from jointsdf.runs.plan import PLAN, plan, planned_runs, read_plan


def test_wanted_runs_add_up_in_their_order(tmp_path: Path) -> None:
    main = tmp_path / "main"
    a, b, c = (main / "base/siren" / name / "seed0" for name in "abc")
    plan(main, [b, a])
    plan(main, [c, b])
    assert planned_runs(main) == [b, a, c]
    assert read_plan(main) == ([b, a, c], "")
    (main / PLAN).write_text("{")
    folders, problem = read_plan(main)
    assert folders == []
    assert problem.startswith(f"{main / PLAN}: not a readable plan: ")
    assert planned_runs(tmp_path / "another") == []
