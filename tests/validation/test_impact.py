"""Spheres dropped on sand, and plates at speed: what is fitted comes back, and depths scale as they must."""

import numpy as np
import pytest
from rftsim_mpm.campaign import DATA, results

from rftsim.sand.medium import Sand
from rftsim.validation import impact


def test_powers_come_back():
    """Depths that follow the measured law have its exponents, and its prefactor."""
    spheres = [
        {"height": height, "diameter": size, "density": density, "friction": friction, "depth": depth}
        for depth in (0.01, 0.02)
        for size in (0.0127, 0.0254)
        for density in (700.0, 2200.0)
        for friction in (0.3, 0.5)
        for height in [(depth / (0.14 / friction * np.sqrt(density / impact.BULK) * size ** (2 / 3))) ** 3 - depth]
    ]
    exponents, factor = impact.law_of(spheres)
    np.testing.assert_allclose(exponents, [1 / 3, 2 / 3, 1 / 2, -1.0], atol=1e-9)
    assert factor == pytest.approx(1.0, rel=1e-12)


@pytest.mark.parametrize("law", ["rft3d", "drft3d"])
def test_a_fall_scales(law):
    """At equal ratios of height, diameter and depth all falls are one: F / (rho g D^3) knows no other length."""
    sand = Sand(rho_c=1510.0, mu_int=0.4, mu_surf=0.3)
    small, large = (impact.drop(law, sand, 4.0 * size, size, 2200.0) / size for size in (0.02, 0.32))
    assert small == pytest.approx(large, rel=5e-3)


def test_inertia_stops_a_sphere_sooner():
    """The faster it falls the more: depths under drft3d over those under rft3d fall with the height."""
    sand = Sand(rho_c=1510.0, mu_int=0.4, mu_surf=0.3)
    depths = np.array(
        [[impact.drop(law, sand, h, 0.0254, 2200.0) for h in (0.02, 0.1, 0.5)] for law in ("rft3d", "drft3d")]
    )
    ratio = depths[1] / depths[0]
    assert (ratio < 1.0).all()
    assert (np.diff(ratio) < 0.0).all()


def test_lambda_comes_back():
    """Plates with F_0 + 1.3 rho A v_n^2 across themselves, and any force along themselves, have lambda 1.3."""
    plates = []
    for beta, gamma in ((0.0, 90.0), (45.0, 0.0), (45.0, 45.0)):
        b, g = np.radians([beta, gamma])
        normal, way = np.array([np.sin(b), 0.0, -np.cos(b)]), np.array([np.cos(g), 0.0, -np.sin(g)])
        along = np.array([np.cos(b), 0.0, np.sin(b)])
        for speed in (1.0, 2.0, 3.0):
            force = -(20.0 + 1.3 * 1500.0 * 0.0025 * (speed * (way @ normal)) ** 2) * normal + 7.0 * speed * along
            plates.append(
                {"beta": beta, "gamma": gamma, "mu_int": 0.4, "cells": 6.0, "rho": 1500.0, "length": 0.05}
                | {"speed": speed, "force": force.tolist()}
            )
    for by_cells in impact.inertia_of(plates).values():
        assert by_cells[6.0] == pytest.approx(1.3, rel=1e-9)


def test_the_continuum_has_an_inertial_term():
    """Forces on flat plates grow as the square of the speed: pairs of speeds give one lambda within 25 %."""
    plates = impact._read(results(DATA / "speeds"))
    flat = [p for p in plates if (p["beta"], p["gamma"], p["mu_int"], p["cells"]) == (0.0, 90.0, 0.4, 6.0)]
    by_pair = [
        impact.inertia_of([p for p in flat if p["speed"] in pair])[0.0, 90.0, 0.4][6.0]
        for pair in ((1.0, 2.0), (2.0, 3.0))
    ]
    assert by_pair[0] == pytest.approx(by_pair[1], rel=0.25)
