"""One operating point: does the rotor settle, and on what?

Solve the reference design at two points from a cold start and print for each the regime, the
maximum Lyapunov exponent per revolution with its standard error (below zero: periodic; zero:
quasi-periodic; above zero: chaotic), the largest eccentricity and the share of time in which the
film is thinner than a tenth of the clearance.

Check: an independent code (docs/model.md, "Values to check against") gives at 7 kg, Λ 6 period 2
and -0.452 ± 0.01, at 18 kg, Λ 4.5 chaos and 0.37 ± 0.06.
"""

from spab_core import reference_design, solve_point

POINTS = ((7.0, 6.0), (18.0, 4.5))  # rotor mass in kg, bearing number


def main() -> None:
    """Solve the points and print a line for each."""
    design = reference_design()
    for rotor_mass, bearing_number in POINTS:
        answer = solve_point(design, rotor_mass, bearing_number)
        if answer.mle is None or answer.regime is None:
            print(f"{rotor_mass:g} kg, Λ {bearing_number:g}: {answer.verdict()}")
            continue
        print(
            f"{rotor_mass:g} kg, Λ {bearing_number:g} ({design.speed_rpm(bearing_number):.0f} "
            f"rpm): {answer.regime.text}, exponent {answer.mle.value:+.3f} ± "
            f"{answer.mle.standard_error:.3f} per revolution, eccentricity to "
            f"{answer.max_eccentricity:.2f}, contact {100 * answer.contact_share:.1f} % of the time"
        )


if __name__ == "__main__":
    main()
