"""Course topics work inside the sandbox: learning, saved models, tables, images, ``eval``, late imports."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import joblib
import numpy as np
import pandas as pd
import pytest
from PIL import Image
from sklearn.ensemble import RandomForestClassifier

from battery import run_text
from responders.sandbox.isolation import Isolation
from responders.sandbox.manager import Sandboxes
from responders.sandbox.roles import ChildRole
from rows import quick_first

_DATA = """
import numpy as np
chance = np.random.default_rng(1)
X = chance.normal(size=(120, 4)); y = (X[:, 0] + X[:, 1] > 0).astype(int)
"""
_LEARN = """
model.fit(X, y)
print(model.score(X, y) > 0.8, model.predict(X[:3]).shape)
"""
_MODELS = {
    "forest": "from sklearn.ensemble import RandomForestClassifier\n"
    "model = RandomForestClassifier(20, n_jobs=4, random_state=1)",
    "network": "from sklearn.neural_network import MLPClassifier\n"
    "model = MLPClassifier((8,), max_iter=2000, solver='lbfgs', random_state=1)",
    "vectors": "from sklearn.svm import SVC\nmodel = SVC()",
    "neighbours": "from sklearn.neighbors import KNeighborsClassifier\nmodel = KNeighborsClassifier(3, n_jobs=4)",
    "pipeline": "from sklearn.pipeline import make_pipeline\nfrom sklearn.preprocessing import StandardScaler\n"
    "from sklearn.linear_model import LogisticRegression\n"
    "model = make_pipeline(StandardScaler(), LogisticRegression())",
    "search": "from sklearn.model_selection import GridSearchCV\nfrom sklearn.tree import DecisionTreeClassifier\n"
    "model = GridSearchCV(DecisionTreeClassifier(), {'max_depth': [2, 4]}, n_jobs=4, cv=3)",
    "boosting": "from sklearn.ensemble import HistGradientBoostingClassifier\n"
    "model = HistGradientBoostingClassifier(max_iter=20)",
}


@pytest.fixture(scope="module", params=["bare", "bubblewrap"])
def sandboxes(request: pytest.FixtureRequest) -> Iterator[Sandboxes]:
    with Sandboxes(Isolation(bubblewrap=request.param == "bubblewrap")) as made:
        reason = made.check_bubblewrap("responder with libraries")
        if request.param == "bubblewrap" and reason is not None:
            pytest.skip(f"bubblewrap does not work here: {reason}")
        yield made


@pytest.fixture
def empty(sandboxes: Sandboxes) -> Iterator[Path]:
    with sandboxes.open_private_folder() as folder:
        yield folder


@pytest.fixture
def folder(empty: Path) -> Path:
    """Return a submission's folder: models saved in several formats, a table and images."""
    chance = np.random.default_rng(1)
    values = chance.normal(size=(60, 4))
    model = RandomForestClassifier(5, n_jobs=2, random_state=1).fit(values, values[:, 0] > 0)
    joblib.dump(model, empty / "plain.joblib")
    joblib.dump(model, empty / "squeezed.joblib.gz", compress=("gzip", 3))
    joblib.dump(model, empty / "squeezed.joblib.xz", compress=("xz", 3))
    joblib.dump({"weights": values}, empty / "arrays.joblib")
    np.save(empty / "array.npy", values)
    pd.DataFrame({"a": [1, 2], "b": [3.5, 4.5]}).to_csv(empty / "table.csv", index=False)
    for kind in ("png", "jpg", "gif", "bmp"):
        Image.new("RGB", (20, 10), "red").save(empty / f"image.{kind}")
    return empty


@pytest.mark.long
@pytest.mark.parametrize("name", quick_first(_MODELS, 3))
def test_models_learn(name: str, sandboxes: Sandboxes, empty: Path) -> None:
    _says(sandboxes, empty, _DATA + _MODELS[name] + _LEARN, ["True (3,)"])


@pytest.mark.long
@pytest.mark.parametrize(
    ("text", "expected_output"),
    [
        pytest.param(
            "import joblib\nfor name in ('plain.joblib', 'squeezed.joblib.gz', 'squeezed.joblib.xz'):\n"
            "    print(joblib.load(name).predict([[1, 0, 0, 0]])[0])",
            ["True"] * 3,
            id="saved-models",
        ),
        pytest.param(
            "import joblib\nweights = joblib.load('arrays.joblib', mmap_mode='r')['weights']\n"
            "print(type(weights).__name__, weights.shape)",
            ["memmap (60, 4)"],
            id="memory-mapped-model",
        ),
        pytest.param(
            "import numpy as np\nprint(np.load('array.npy', mmap_mode='r').shape)\n"
            "np.savez_compressed('mine.npz', a=np.arange(3)); print(np.load('mine.npz')['a'].sum())",
            ["(60, 4)", "3"],
            id="numpy-files",
        ),
        pytest.param(
            "import pandas as pd\ntable = pd.read_csv('table.csv'); print(table.b.sum())\n"
            "table.to_csv('mine.csv'); print(len(pd.read_csv('mine.csv').groupby('a').mean()))",
            ["8.0", "2"],
            id="tables",
        ),
        pytest.param(
            "from PIL import Image, ImageFilter\nfor kind in ('png', 'jpg', 'gif', 'bmp'):\n"
            "    image = Image.open(f'image.{kind}').convert('L').resize((4, 4)).filter(ImageFilter.BLUR)\n"
            "    image.save('mine.' + kind); print(image.size)",
            ["(4, 4)"] * 4,
            id="images",
        ),
        pytest.param(
            "print(eval('{\"shape\": [1, 2]}')['shape'], eval('2 ** 10'))\nexec('x = 5')\nprint(x)",
            ["[1, 2] 1024", "5"],
            id="eval",
        ),
        pytest.param(
            "import tempfile, os\nwith tempfile.NamedTemporaryFile() as file: file.write(b'x')\n"
            "print(len(os.listdir(os.getcwd())) > 5, len(open(os.path.abspath('table.csv')).read()) > 5)\n"
            "with open('logger.txt', 'a') as log: log.write('line')\nos.rename('logger.txt', 'old.txt')\n"
            "os.remove('old.txt'); print('ok')",
            ["True True", "ok"],
            id="own-files",
        ),
        pytest.param(
            "import sqlite3\nd = sqlite3.connect(':memory:'); print(d.execute('select 6 * 7').fetchone()[0])\n"
            "import csv, io, gzip, bz2, lzma, zipfile, hashlib, decimal, fractions, zoneinfo\n"
            "print(zoneinfo.ZoneInfo('Europe/London').key, hashlib.sha256(b'').hexdigest()[:4])",
            ["42", "Europe/London e3b0"],
            id="standard-library",
        ),
    ],
)
def test_it_works(text: str, expected_output: list[str], sandboxes: Sandboxes, folder: Path) -> None:
    _says(sandboxes, folder, text, expected_output)


@pytest.mark.long
@pytest.mark.parametrize("role", quick_first(["robot", "responder with libraries", "responder"], 2))
def test_the_standard_library_can_be_imported_late(role: ChildRole, sandboxes: Sandboxes, empty: Path) -> None:
    """Covers every importable module of the standard library, except those that draw or need a display."""
    left_out = {"antigravity", "this", "idlelib", "tkinter", "turtle", "turtledemo", "lib2to3", "ensurepip", "test"}
    names = sorted(sys.stdlib_module_names - left_out)
    text = f"""
import importlib, warnings
warnings.simplefilter("ignore")
for name in {names!r}:
    try:
        importlib.import_module(name)
    except ModuleNotFoundError:
        pass
    except BaseException as error:
        print(name, repr(error))
"""
    _says(sandboxes, empty, text, [], role)


def _says(
    sandboxes: Sandboxes,
    folder: Path,
    text: str,
    expected_output: list[str],
    role: ChildRole = "responder with libraries",
) -> None:
    lines, stop = run_text(sandboxes, role, text + "\ndef responder(text): return text\n", folder)
    assert (lines, stop) == (expected_output, None)
