import logging

from devices.diagnosis import Diagnosis, Level


def test_each_change_is_told_once(caplog):
    caplog.set_level(logging.INFO)
    diagnosis = Diagnosis("head")
    told = [
        diagnosis.report(*what)
        for what in [
            (Level.ERROR, "absent"),
            (Level.ERROR, "absent"),
            (Level.OK, "tracked", "CV1"),
            (Level.ERROR, "absent"),
        ]
    ]
    assert [len(samples) for samples in told] == [1, 0, 1, 1]
    status = told[2][0].message
    assert (told[2][0].port, status.level, status.name, status.message, status.hardware_id) == (
        "diagnostics",
        0,
        "head",
        "tracked",
        "CV1",
    )
    assert [record.levelname for record in caplog.records] == ["WARNING", "INFO", "WARNING"]
    assert caplog.messages[0] == "device 'head': absent"
