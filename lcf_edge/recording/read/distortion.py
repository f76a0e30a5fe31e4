"""Names of lens distortion models in recordings, and their names here."""

from typing import Literal

from lcf_edge.printable import printable

Model = Literal["none", "radial-tangential", "equidistant"]

MODELS: dict[str, Model] = {
    "": "none",
    "none": "none",
    "radial-tangential": "radial-tangential",
    "radtan": "radial-tangential",
    "plumb_bob": "radial-tangential",
    "rational_polynomial": "radial-tangential",
    "brown-conrady": "radial-tangential",
    "equidistant": "equidistant",
    "equi": "equidistant",
    "fisheye": "equidistant",
    "kannala-brandt": "equidistant",
}


def distortion(name: str, coefficients: tuple[float, ...]) -> tuple[Model, tuple[float, ...]]:
    """Return model and coefficients as ``Lens`` takes them; a model whose coefficients are all zero is none.

    The rational model is the radial-tangential one where its denominator is 1. Raises ``ValueError`` that
    says what is wrong.
    """
    model = MODELS.get(name.lower())
    if model is None:
        raise ValueError(f"{printable(name, 60)} is not one of {', '.join(filter(None, MODELS))}")
    if model == "none" or not any(coefficients):
        return "none", ()
    counts = (4,) if model == "equidistant" else (4, 5)
    used = coefficients[: counts[-1]]
    if any(coefficients[counts[-1] :]):
        raise ValueError(f"{name} with {len(coefficients)} coefficients is not supported")
    if len(used) not in counts:
        raise ValueError(f"{name} takes {' or '.join(map(str, counts))} coefficients")
    return model, used
