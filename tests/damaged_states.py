"""Status files and plans of studies, damaged: a table by name of the case."""

from typing import Any

from damaged_documents import NO_COUNT, NO_SCORE, WHOLE, Plant, holding, with_value

STATUS: dict[str, Plant] = {
    **WHOLE,
    **{f"{key} is {case}": with_value(key, value) for key in ("step", "steps") for case, value in NO_COUNT.items()},
    **{f"seconds is {case}": with_value("seconds", value) for case, value in NO_SCORE.items()},
    **{f"died_at is {case}": with_value("died_at", value) for case, value in NO_COUNT.items() if value is not None},
    **{f"{key} is missing": with_value(key, ...) for key in ("state", "step", "steps", "seconds")},
    "negative seconds": with_value("seconds", -1.0),
    "an unknown state": with_value("state", "done"),
    "a state in a list": with_value("state", ["running"]),
    "a failure without a reason": holding(lambda _: '{"state": "failed"}'),
    "a failure with a list as reason": holding(lambda _: '{"state": "failed", "error": ["a"]}'),
}

NO_RUNS: dict[str, Any] = {
    "null": None,
    "text": "base/siren/abc_0001/seed0",
    "an object": {"base/siren/abc_0001/seed0": 1},
    "a number": [3],
    "a list": [["base/siren/abc_0001/seed0"]],
    "no text": [""],
    "a dot": ["."],
    "an absolute path": ["/base/siren/abc_0001/seed0"],
    "a path out of the study": ["../main/base/siren/abc_0001/seed0"],
    "four names, one of them above": ["../../../../etc/passwd/a/.."],
    "four names that leave the study": ["../../etc/passwd"],
    "one name": ["abc_0001"],
    "five names": ["a/base/siren/abc_0001/seed0"],
    "an empty name": ["base//abc_0001/seed0"],
    "a dot among the names": ["base/./abc_0001/seed0"],
    "two lines": ["base/siren/abc\n0001/seed0"],
    "an escape sequence": ["base/siren/\x1b[2J/seed0"],
    "a NUL": ["base/siren/abc\x000001/seed0"],
    "half a surrogate pair": ["base/siren/\ud800/seed0"],
    "300 characters": [f"base/siren/{'x' * 300}/seed0"],
    "a backslash path": ["base\\siren\\abc_0001\\seed0"],
}
PLANS: dict[str, Plant] = {
    **WHOLE,
    **{f"the runs are {case}": with_value("runs", value) for case, value in NO_RUNS.items()},
    "a bad one among good ones": with_value("runs", ["base/siren/abc_0001/seed0", "/etc/a/b/c"]),
}
