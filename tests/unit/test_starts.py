"""``spab simulate --start`` and ``--out``: a run goes on from a file or from a large orbit."""

import pytest

from spab_core.design.model import reference_design
from spab_core.trajectory.point import solve_point
from spab_core.trajectory.point_file import load_point, save_point
from spab_core.trajectory.settings import Settings
from tests.commands import answer, refused

POINT = ("simulate", "--rotor-mass", "4.52", "--bearing-number", "1.4")
SHORT = ("--transient", "30", "--revolutions", "20")


@pytest.mark.slow
def test_another_motion_is_reached_from_a_large_orbit_and_kept_from_a_file(capsys, tmp_path):
    """At 4.52 kg and Lambda 1.4 rest leads to period 1 with e 0.37, a large orbit to a whirl of
    0.83; from that whirl's last state the whirl goes on, without a load to raise.
    """
    file = str(tmp_path / "whirl.npz")
    rest = answer(capsys, *POINT)
    whirl = answer(capsys, *POINT, "--start", "whirling", "--out", file)
    assert rest["period"] == 1 and rest["max_eccentricity"] < 0.5
    assert whirl["max_eccentricity"] == pytest.approx(0.83, abs=0.02)
    again = answer(capsys, *POINT, "--start", file, "--transient", "0", "--revolutions", "100")
    assert again["max_eccentricity"] == pytest.approx(whirl["max_eccentricity"], abs=0.01)
    kept = load_point(file)
    assert (kept.rotor_mass, kept.bearing_number) == (4.52, 1.4)


def test_wrong_starts_are_refused(capsys, tmp_path):
    file = tmp_path / "p.npz"
    answer(capsys, *POINT, *SHORT, "--mesh", "2x16", "--out", str(file))
    for options, words in (
        (("--start", "no.npz"), "cannot read the operating point"),
        (("--start", str(file), "--mesh", "3x16"), "it ended on mesh 2x16, this one asks for 3x16"),
        (("--start", str(file), "--out", str(tmp_path / "no" / "p.npz")), "--out"),
        (("--transient", "5"), "transient = 5 revolutions is too short"),
    ):
        assert words in refused(capsys, *POINT, *options), words


def test_the_end_of_a_failed_run_is_no_start(capsys, tmp_path):
    file = str(tmp_path / "failed.npz")
    bare = reference_design().replace(contact__force_at_closure=0.0)
    failed = solve_point(bare, 25.0, 0.5, Settings(transient=30, revolutions=20))
    assert failed.trajectory.status == "touchdown"
    save_point(failed, file)
    assert "its last state is no start" in refused(capsys, *POINT, "--start", file)
