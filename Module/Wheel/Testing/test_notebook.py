# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""The notebook runs from a sweep to slices, and draws. Skipped where nbclient, ipykernel or matplotlib is missing.

BIGUS_PICTURES names a folder for what it draws.
"""

import base64
import os
import pathlib
import sys
import tempfile
import unittest

try:
    import ipykernel  # noqa: F401
    import matplotlib  # noqa: F401
    import nbclient
    import nbformat
except ImportError as error:
    print(f"skipped: {error}")
    sys.exit(77)

NOTEBOOK = pathlib.Path(__file__).resolve().parents[3] / "Examples" / "Wheel" / "sweep_to_slice.ipynb"


class Notebook(unittest.TestCase):
    def test_from_sweep_to_slice(self):
        notebook = nbformat.read(NOTEBOOK, as_version=4)
        self.assertFalse(any(cell.get("outputs") for cell in notebook.cells), "the notebook is kept without outputs")
        with tempfile.TemporaryDirectory() as folder:
            client = nbclient.NotebookClient(notebook, timeout=300, kernel_name="python3", resources={"metadata": {"path": folder}})
            client.execute()
            self.assertTrue({"sweep.igs.mha", "field.vtp"} <= set(os.listdir(folder)))
        outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
        self.assertFalse([output for output in outputs if output.get("name") == "stderr"])
        pictures = [base64.b64decode(output["data"]["image/png"]) for output in outputs if "image/png" in output.get("data", {})]
        for number, picture in enumerate(pictures if "BIGUS_PICTURES" in os.environ else ()):
            pathlib.Path(os.environ["BIGUS_PICTURES"], f"notebook-{number}.png").write_bytes(picture)
        texts = " ".join(output["data"]["text/plain"] for output in outputs if "text/plain" in output.get("data", {}))
        self.assertIn("<bigus.Sweep of 48 frames, 96 x 80 pixels>", texts)
        psnr = float(texts.split("'psnr': ")[1].split(",")[0])
        self.assertGreater(psnr, 25)
        self.assertEqual(len(pictures), 4)


if __name__ == "__main__":
    unittest.main(verbosity=2)
