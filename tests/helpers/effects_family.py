"""One sample of every effect, and scenes made of them: the family over which the laws of test_effects_laws.py run."""

from __future__ import annotations

from mcdem.effects import EFFECTS, ContactLaw, Effects, PairForce, Resistance
from mcdem.scene import Scene

# The paper's Table 1; the rest typical of polystyrene latex in water.
ELASTIC = {"surface_energy": "4.7 mJ/m^2", "elastic_modulus": "3.4 GPa", "poisson_ratio": 0.5}
DOUBLE_LAYER = {"surface_potential": "-25 mV", "debye_length": "10 nm", "relative_permittivity": 78.5}
TABLES: dict[str, dict[str, object]] = {
    "van_der_waals": {"hamaker_constant": "0.97e-20 J", "minimum_approach": "0.165 nm"},
    "double_layer": DOUBLE_LAYER | {"condition": "constant_potential"},
    "born": {"collision_diameter": "0.5 nm"},
    "steric": {"brush_thickness": "10 nm", "grafting_distance": "3 nm", "temperature": "298 K"},
    "jkr": ELASTIC,
    "dmt": ELASTIC,
    "sliding": {"friction_coefficient": 0.3},
    "rolling": {"critical_displacement": "0.5 nm"},
    "twisting": {"friction_coefficient": 0.3},
    "rods": {"stiffness": "5 N/m", "largest_displacement": "2 nm"},
}
VARIANTS: dict[str, tuple[str, dict[str, object]]] = {
    "unretarded": ("van_der_waals", TABLES["van_der_waals"] | {"retarded": False}),
    "constant_charge": (
        "double_layer",
        DOUBLE_LAYER | {"condition": "constant_charge", "minimum_approach": "0.165 nm"},
    ),
}
NEEDS = {"born": "van_der_waals", "sliding": "jkr", "rolling": "jkr", "twisting": "jkr", "rods": "jkr"}


def of_kind(kind: type) -> list[str]:
    """The effects of one kind, and their variants, as a test goes over them."""
    named = {name: name for name in EFFECTS} | {name: effect for name, (effect, _) in VARIANTS.items()}
    return [name for name, effect in named.items() if isinstance(EFFECTS[effect], kind)]


PAIR_FORCES, CONTACT_LAWS, RESISTANCES = of_kind(PairForce), of_kind(ContactLaw), of_kind(Resistance)


def effect_of(name: str) -> str:
    """The effect of which this is a variant, or itself."""
    return VARIANTS[name][0] if name in VARIANTS else name


def effects(*names: str) -> Effects:
    """The effects named, and what they need."""
    tables = {}
    for name in names:
        effect, table = VARIANTS.get(name, (name, TABLES.get(name)))
        if effect in NEEDS and not {"jkr", "dmt"} & set(names):
            tables.setdefault(NEEDS[effect], TABLES[NEEDS[effect]])
        tables[effect] = table
    return Effects.model_validate(tables)


def scene(*names: str, radius: float = 500e-9) -> Scene:
    """The paper's suspension at 1000 Pa with the effects named, and what they need."""
    return Scene.model_validate(
        {
            "suspension": {"radius": f"{radius!r} m", "volume_fraction": 1e-4},
            "flow": {"shear_rate": "1e4 1/s", "viscosity": "100 cP"},
            "effects": effects(*names),
        }
    )


def kernel(whole: Scene, name: str):
    """The parameters of an effect of a scene in reduced units."""
    return whole.effects.get(effect_of(name)).kernel(whole.reduced, whole.suspension, whole.effects)


def kernels(*names: str, radius: float = 500e-9):
    """Those of all effects of such a scene, as compiled code takes them."""
    whole = scene(*names, radius=radius)
    return whole.kernels
