"""D as an operator, orders in brackets, and named matrices mean what is written out beside them."""

import pytest

from inverse_service.errors import InputError
from inverse_service.service.documents.documents import parse_document
from tests.doors.judge import same_formula

TWO = "2*x_1'' + 3*x_1 - x_2 = 0; x_2'' - x_1 + x_2 = 0"
PAIRS = {
    "M x'' + K x = 0; M = [[2, 0], [0, 1]]; K = [[3, -1], [-1, 1]]": TWO,
    "M = [2 0; 0 1]; K = [3 -1; -1 1]; M*x'' = -K*x": TWO,
    "M = {{2, 0}, {0, 1}}; K = {{3, -1}, {-1, 1}}; M x'' + K x = 0": TWO,
    "M = Matrix([[2, 0], [0, 1]]); K = np.array([[3,-1],[-1,1]]); M*x'' + K*x = 0": TWO,
    r"M\ddot{\mathbf x} + K\mathbf x = 0, M = \begin{pmatrix} 2 & 0 \\ 0 & 1 \end{pmatrix},"
    r" K = \begin{pmatrix} 3 & -1 \\ -1 & 1 \end{pmatrix}": TWO,
    "L = 1/2 x'^T M x' - 1/2 x^T K x, M = [[2,0],[0,1]], K = [[3,-1],[-1,1]]": TWO,
    r"L = \frac12 \dot{\mathbf x}^T M \dot{\mathbf x} - \frac12 \mathbf x^T K \mathbf x,"
    r" M = \begin{pmatrix} 2 & 0 \\ 0 & 1 \end{pmatrix},"
    r" K = \begin{pmatrix} 3 & -1 \\ -1 & 1 \end{pmatrix}": TWO,
    "C q'' = A q + b; q = (x, y); C = [[1, 0], [0, 2]]; A = [[0, a], [-a, 0]]; b = [1, t]": (
        "x'' = a*y + 1; y'' = (t - a*x)/2"
    ),
    "x' = A x; A = [[0, 1], [-4, 0]]": "x_1'' = -4*x_1",
    "(D^2 + 2 z D + w^2) x = sin(t)": "x'' + 2*z*x' + w^2*x = sin(t)",
    "(D - a)(D + b) x = 0": "x'' + (b - a)*x' - a*b*x = 0",
    "(m D^2 - k) x + c D y = 0; (D^2 + 1) y = 0": "m*x'' - k*x + c*y' = 0; y'' + y = 0",
    "x^{(2)} + 2 x^{(1)} + x = 0": "x'' + 2*x' + x = 0",
    "m*a = -k*x, a = x''": "m*x'' = -k*x",
}


@pytest.mark.parametrize("given", PAIRS)
def test_means_what_is_written_out(given: str) -> None:
    found, wanted = (
        parse_document({"equations": text, "parameters": "guess"}) for text in (given, PAIRS[given])
    )
    assert found["coordinates"] == wanted["coordinates"]
    for name, part in wanted["equations"].items():
        text = found["equations"][name]["text"]
        assert same_formula(text, part["text"], found["coordinates"]), text


@pytest.mark.parametrize(
    "given",
    [
        "(x D + 1)(x D + 2) y = 0",  # D acts on x, too
        "M q'' + K q = F; M = [[2, 0], [0, 1]]; K = [[3, -1], [-1, 1]]",  # F has no components
        "M q'' = -q; M = [[2, 0], [0]]",
        r"\ddot x = -x^{(1)}",
    ],
)
def test_is_asked_back(given: str) -> None:
    with pytest.raises(InputError):
        parse_document({"equations": given, "parameters": "guess"})


@pytest.mark.parametrize(
    ("given", "printed"),
    [("x'' = -3.27*5 x", "-16.35*x"), ("x'' = -0.1*5 x", "-x/2"), ("x'' = -0.3*5 x", "-3*x/2")],
)
def test_a_multiple_of_a_typed_decimal_is_a_decimal_if_that_is_shorter(
    given: str, printed: str
) -> None:
    found = parse_document({"equations": given, "parameters": "guess"})
    assert found["equations"]["x"]["text"] == printed


@pytest.mark.parametrize(
    "right", [r"-k/\vec{r}", r"-k \vec{r}^2", r"-2^{\vec{r}}", r"-\vec{r}/\vec{r}"]
)
def test_a_vector_that_divides_or_is_raised_has_no_components(right: str) -> None:
    """-k/r for each component is another equation than any that was meant."""
    with pytest.raises(InputError, match="vector"):
        parse_document({"equations": rf"\ddot{{\vec{{r}}}} = {right}", "parameters": "guess"})


def test_a_dot_between_vectors_is_their_scalar_product() -> None:
    r"""\cdot and \times are two products: of a vector with itself the square, and 0."""
    given = {
        r"L = \frac{1}{2} \dot{\mathbf r} \cdot \dot{\mathbf r} - \mathbf r \cdot \mathbf r": "-2*x",
        r"\ddot{\mathbf r} = -(\mathbf r \cdot \mathbf r) \mathbf r": "-(x^2 + y^2)*x",
    }
    for text, wanted in given.items():
        lines = rf"{text}; \mathbf r = (x, y)"
        found = parse_document({"equations": lines, "parameters": "guess"})
        assert same_formula(found["equations"]["x"]["text"], wanted, ["x", "y"])
