"""A material from what an indenter measured: the laws, the fit with noise, its deviations, the file."""

import csv
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from typer.testing import CliRunner

from engines.bullet.calibration.command_line import app
from engines.bullet.calibration.fit import calibrate
from engines.bullet.calibration.indentation import Indenter, elastic_force
from engines.bullet.calibration.measurements import Measured, read
from engines.bullet.calibration.relaxation import Prony
from engines.tissue.organs.material_file import MaterialFile
from engines.tissue.organs.params import OrganParams
from schemas.errors import RecordingError

SPHERE = Indenter("sphere", 5e-3)
LIVER = Prony((0.25, 0.3), (0.4, 8.0))


def pressed(*, seed=0, noise=0.01, indenter=SPHERE, modulus=8e3, stiffening=0.0, prony=LIVER, friction=None):
    """Return a press of 4 mm in 0.2 s, held for 20 s, with noise relative to the largest force."""
    time = np.concatenate([np.linspace(0.0, 0.4, 41), np.linspace(0.5, 20.0, 196)])
    depth = np.clip(time / 0.2, 0.0, 1.0) * 4e-3 - 1e-4
    force = prony.relaxed(time, elastic_force(indenter, depth, modulus, stiffening))
    rng = np.random.default_rng(seed)
    force = force + noise * force.max() * rng.standard_normal(time.size)
    if friction is None:
        return Measured(time, depth, force)
    slide = np.maximum(time - 15.0, 0.0) * 2e-3
    drag = friction * force * (time > 15.0) + noise * force.max() * rng.standard_normal(time.size)
    return Measured(time, depth, force, slide, drag)


@given(st.floats(0.0, 1.99), st.floats(1e-3, 1e-2))
def test_the_force_grows_with_the_depth(ratio, radius):
    indenter = Indenter("sphere", radius)
    shallow, deep = elastic_force(indenter, np.array([ratio, ratio + 0.01]) * radius, 1e4, 0.0)
    assert deep > shallow >= 0.0


@pytest.mark.parametrize(
    ("nu", "thickness_mm", "more"),
    [
        (0.3, 8, [1.320, 1.485, 1.603]),
        (0.4, 8, [1.363, 1.556, 1.706]),
        (0.4, 12, [1.217, 1.316, 1.392]),
        (0.4, 20, [1.117, 1.166, 1.198]),
        (0.45, 12, [1.234, 1.344, 1.428]),
    ],
)
def test_a_layer_is_stiffer_than_a_half_space_as_finite_elements_say(nu, thickness_mm, more):
    """A bonded neo-Hookean layer under a sphere of 5 mm, 1, 2 and 3 mm deep: axisymmetric finite elements."""
    depth = np.array([1e-3, 2e-3, 3e-3])
    layer, thick = (Indenter("sphere", 5e-3, t, nu) for t in (thickness_mm * 1e-3, None))
    found = elastic_force(layer, depth, 1e4, 0.0) / elastic_force(thick, depth, 1e4, 0.0)
    assert np.allclose(found, more, rtol=0.03)


@pytest.mark.parametrize(("depth_mm", "converged_n"), [(1, 0.0317), (2, 0.101), (3, 0.192)])
def test_a_layer_has_the_force_of_converged_finite_elements(depth_mm, converged_n):
    """On a block of 80 x 60 x 20 mm, 10 kPa, whose top its own weight lowers."""
    bulk = 1e4 * (1 - 0.4) / (1 + 0.4) / (1 - 0.8)
    sag = 1000 * 9.81 * 0.02**2 / 2 / bulk
    force = elastic_force(Indenter("sphere", 5e-3, 0.02, 0.4), np.array(depth_mm * 1e-3 - sag), 1e4, 0.0)
    assert float(force) == pytest.approx(converged_n, rel=0.06)


def test_a_layer_is_a_half_space_where_it_is_thick():
    depth = np.linspace(0.0, 5e-3, 11)
    thick = elastic_force(Indenter("sphere", 5e-3, 1e3), depth, 1e4, 0.0)
    assert np.allclose(thick, elastic_force(SPHERE, depth, 1e4, 0.0), rtol=1e-4)


@given(st.floats(0.0, 0.45), st.floats(0.0, 0.45), st.floats(0.05, 1.0), st.floats(1.5, 20.0))
def test_relaxation_is_the_convolution(first, second, quick, slow):
    prony = Prony((first, second), (quick, slow))
    time = np.array([0.0, 0.3, 0.5, 1.7, 2.0, 6.0])
    elastic = np.array([0.0, 1.0, 0.7, 0.7, 1.5, 1.5])
    fine = np.linspace(0.0, 6.0, 60001)
    rate = np.diff(np.interp(fine, time, elastic)) / np.diff(fine)
    middle = (fine[1:] + fine[:-1]) / 2
    kernel = 1.0 - sum(
        share * (1 - np.exp(-(6.0 - middle) / tau))
        for share, tau in zip(prony.shares, prony.times, strict=True)
    )
    assert prony.relaxed(time, elastic)[-1] == pytest.approx(
        (kernel * rate).sum() * (fine[1] - fine[0]), abs=1e-5
    )


def test_the_moduli_at_a_frequency_are_those_of_a_swing():
    frequency = 0.7
    time = np.linspace(0.0, 200.0, 200001)
    force = LIVER.relaxed(time, np.sin(2 * np.pi * frequency * time))[-100000:]
    swing = np.exp(-2j * np.pi * frequency * time[-100000:])
    answer = 2j * np.mean(force * swing)
    storage, damping = LIVER.at(frequency)
    assert answer.real == pytest.approx(storage, rel=1e-3)
    assert answer.imag / answer.real / (2 * np.pi * frequency) == pytest.approx(damping, rel=1e-2)


@pytest.mark.long
@pytest.mark.parametrize(
    ("indenter", "stiffening"),
    [(SPHERE, 0.0), (Indenter("sphere", 5e-3, 15e-3), 0.0), (Indenter("punch", 3e-3), 0.0), (SPHERE, 12.0)],
    ids=["sphere", "layer", "punch", "two parameters"],
)
def test_what_was_put_in_is_found_within_its_deviations(indenter, stiffening):
    errors = []
    for seed in range(4):
        found = calibrate(
            pressed(seed=seed, indenter=indenter, stiffening=stiffening, noise=0.02),
            indenter,
            two_parameters=bool(stiffening),
        )
        wanted = {
            "young_modulus": (found.young_modulus, 8e3),
            "surface": (found.surface, 0.0),
            "share_1": (found.relaxation.shares[0], 0.25),
            "share_2": (found.relaxation.shares[1], 0.3),
            "time_1": (found.relaxation.times[0], 0.4),
            "time_2": (found.relaxation.times[1], 8.0),
        }
        assert (found.stiffening is None) == (not stiffening)
        if found.stiffening is not None:
            wanted["stiffening"] = found.stiffening, stiffening
        errors.append([(value - true) / found.deviations[name] for name, (value, true) in wanted.items()])
        assert found.residual < 0.05
    assert np.sqrt(np.mean(np.square(errors))) < 1.6
    assert np.abs(errors).max() < 5.0


def test_less_noise_is_less_deviation():
    loud, quiet = (calibrate(pressed(noise=noise), SPHERE) for noise in (0.03, 0.003))
    for name in ("young_modulus", "share_1", "time_2"):
        assert quiet.deviations[name] < 0.2 * loud.deviations[name]


def test_friction_is_found_while_the_indenter_slides():
    found = calibrate(pressed(friction=0.35), SPHERE)
    assert found.friction == pytest.approx(0.35, abs=4 * found.deviations["friction"])
    assert 0.0 < found.deviations["friction"] < 0.02
    assert calibrate(pressed(), SPHERE).friction is None


def test_what_the_data_does_not_tell_has_a_large_deviation():
    found = calibrate(pressed(prony=Prony((0.3, 0.0), (0.5, 5.0)), noise=0.02), SPHERE)
    doubts = [found.deviations[f"time_{i}"] / time for i, time in enumerate(found.relaxation.times, 1)]
    assert max(doubts) > 0.5


@pytest.mark.parametrize(
    ("indenter", "message"),
    [
        (Indenter("sphere", 1.5e-3), "allowed up to 2.5 radii"),
        (Indenter("sphere", 8e-3, 4e-3), "too thin for a contact"),
        (Indenter("punch", 5e-3, 2e-2), "for a sphere only"),
    ],
)
def test_where_no_law_holds_it_says_so(indenter, message):
    with pytest.raises(RecordingError, match=message):
        calibrate(pressed(), indenter)


def test_a_force_of_the_wrong_sign_is_refused():
    good = pressed()
    with pytest.raises(RecordingError, match="does not grow"):
        calibrate(Measured(good.time, good.depth, -good.force), SPHERE)


def write(path, measured):
    names = [name for name, column in vars(measured).items() if column is not None]
    with path.open("w", newline="") as file:
        rows = csv.writer(file)
        rows.writerow(names)
        rows.writerows(zip(*(getattr(measured, name).tolist() for name in names), strict=True))
    return path


def test_a_table_reads_back(tmp_path):
    measured = pressed(friction=0.2)
    back = read(write(tmp_path / "press.csv", measured))
    for name, column in vars(measured).items():
        assert np.array_equal(getattr(back, name), column)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("time,dept,force\n", "no column 'depth'. Did you mean 'dept'"),
        ("time,depth,force\n" + "0,0,0\n" * 30, "does not increase"),
        ("time,depth,force\n" + "0,0,x\n", "not a table of numbers"),
        ("time,depth,force\n" + "0,0,0\n" * 3, "3 samples, at least 20"),
        ("time,depth,force\n" + "\n".join(f"{i},0,nan" for i in range(30)), "not finite"),
        (
            "time,depth,force\n0,1\n" + "\n".join(f"{i},0,1" for i in range(30)),
            "line 2 has 2 numbers, the first line 3",
        ),
    ],
)
def test_an_unusable_table_is_refused(text, message, tmp_path):
    file = tmp_path / "bad.csv"
    file.write_text(text)
    with pytest.raises(RecordingError, match=message):
        read(file)


def run(*words):
    return CliRunner().invoke(app, ["tissue", *map(str, words)])


def test_a_fit_that_explains_little_is_warned_of(tmp_path):
    measured = pressed()
    force = measured.force * (1.0 + 0.8 * np.sin(25.0 * measured.time))
    data = write(tmp_path / "press.csv", replace(measured, force=force))
    result = run(data, "--shape", "sphere", "--radius", "5 mm", "-o", tmp_path / "mine.yaml")
    assert result.exit_code == 0, result.output
    assert "of the force is unexplained, at most 10% are expected" in result.stderr


def test_a_missing_output_directory_is_said_before_the_fit(tmp_path):
    data = write(tmp_path / "press.csv", pressed())
    result = run(data, "--shape", "sphere", "--radius", "5 mm", "-o", tmp_path / "no" / "mine.yaml")
    assert "there is no directory" in str(result.exception)


def test_a_scenario_names_what_the_command_wrote(tmp_path):
    data, file = write(tmp_path / "press.csv", pressed(friction=0.35)), tmp_path / "mine.yaml"
    result = run(data, "--shape", "sphere", "--radius", "5 mm", "--frequency", "2", "-o", file)
    assert result.exit_code == 0, result.output
    assert "modulus at once, kPa" in result.output
    organ = {"size": ["60 mm", "60 mm", "20 mm"], "nodes": 75, "material_file": str(file)}
    context = {"directory": tmp_path}
    params = OrganParams.model_validate(organ, context=context)
    storage, damping = LIVER.at(2.0)
    assert params.elastic.young_modulus == pytest.approx(8e3 * storage, rel=0.05)
    assert params.elastic.damping == pytest.approx(damping, rel=0.15)
    assert params.contact_friction == pytest.approx(0.35, rel=0.05)
    stated = OrganParams.model_validate({**organ, "damping": "1 ms", "friction": 0.1}, context=context)
    assert (stated.elastic.damping, stated.contact_friction) == (1e-3, 0.1)


def test_a_material_file_is_beside_its_scenario(tmp_path):
    text = MaterialFile(young_modulus=5e3, poisson_ratio=0.4, density=1050.0, damping=1e-3).text()
    (tmp_path / "mine.yaml").write_text(text)
    organ = {"size": ["60 mm", "60 mm", "20 mm"], "nodes": 75, "material_file": "mine.yaml"}
    params = OrganParams.model_validate(organ, context={"directory": tmp_path})
    assert params.elastic.young_modulus == 5e3
    assert params.contact_friction == params.friction


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("young_modulus: 5", "young_modulus: .* outside"),
        ("a: [", "not YAML"),
        (None, "cannot read"),
        ("#" * 70000, "larger than"),
    ],
)
def test_an_unusable_material_file_is_refused(content, message, tmp_path):
    file = tmp_path / "mine.yaml"
    if content is not None:
        file.write_text(content)
    with pytest.raises(ValueError, match=message):
        MaterialFile.load(file)


def test_one_material_is_enough(tmp_path):
    organ = {"size": ["60 mm", "60 mm", "20 mm"], "material_file": "a.yaml", "material": "liver"}
    with pytest.raises(ValueError, match="one of them"):
        OrganParams.model_validate(organ, context={"directory": tmp_path})


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--shape", "cone", "--radius", "5 mm"), "none of sphere, punch"),
        (("--shape", "sphere", "--radius", "5 kg"), "not a quantity in m"),
        (("--shape", "punch", "--radius", "5 mm", "--two-parameters"), "for a sphere only"),
    ],
)
def test_bad_usage_is_refused(words, message, tmp_path):
    result = run(write(tmp_path / "press.csv", pressed()), *words, "-o", tmp_path / "mine.yaml")
    assert result.exit_code == 2
    assert message in " ".join(result.output.replace("│", " ").split())
    assert not (tmp_path / "mine.yaml").exists()
