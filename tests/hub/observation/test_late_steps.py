from hub.observation.late_steps import LateSteps

MS = 1_000_000


def test_a_step_that_only_catches_up_has_the_cause_of_the_one_before():
    late = LateSteps()
    late.add(1, MS, 5 * MS, {"hub": 100, "participant robot": 20 * MS})
    for step in range(6, 9):
        late.add(1, MS, step * MS, {"hub": MS // 2})
    late.add(2, 2 * MS, 11 * MS, {"hub": 3 * MS, "participant robot": MS})
    assert [(one.cause, one.steps) for one in late.cause_counts] == [("participant robot", 4), ("hub", 2)]
    assert [(one.time_ns, one.took_s, one.cause) for one in late.worst_steps] == [
        (5 * MS, 0.0200001, "participant robot"),
        (11 * MS, 0.004, "hub"),
    ]


def test_the_longest_steps_are_kept():
    late = LateSteps()
    for step in range(1, 50):
        late.add(1, MS, step * MS, {"hub": MS + step % 25})
    assert [one.time_ns for one in late.worst_steps] == [49 * MS, 24 * MS, 48 * MS, 23 * MS, 47 * MS]
