# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""A scripted module of 3D Slicer: a plane markup, and what a field shows there while the plane is moved.

Not run in Slicer itself. Its logic is tested with plain Python, and with the classes of Slicer's scene in the package
slicer-core of PyPI (Testing/Python/test_slicer_example.py).

In Slicer: Edit, Application Settings, Modules, Additional module paths: add this folder. The module appears under
Ultrasound, BIGUS.
"""
import math

import numpy as np

try:
    import ctk
    import qt
    import slicer
    import vtk
    from slicer.ScriptedLoadableModule import ScriptedLoadableModule, ScriptedLoadableModuleLogic, ScriptedLoadableModuleWidget
    from slicer.util import VTKObservationMixin
except ImportError:  # outside Slicer only the logic is of use
    ScriptedLoadableModule = ScriptedLoadableModuleLogic = object
    ScriptedLoadableModuleWidget, VTKObservationMixin = type("Widget", (), {}), type("Mixin", (), {})

MOST_PIXELS = 4096  # a side; a plane of 2 m at 0.5 mm


def plane_grid(to_world, size, spacing):
    """The pixels that cover a plane: (pose [4, 4] from pixel (i, j, 0, 1) to mm, width, height).

    to_world: [4, 4], a plane's object to world matrix: its axes, and its middle in the last column, mm, RAS.
    size: width and height, mm. spacing: between pixels, mm.
    """
    to_world = np.asarray(to_world, float)
    width, height = (max(1, math.floor(side / spacing + 0.5)) for side in size[:2])
    if not (0 < width <= MOST_PIXELS and 0 < height <= MOST_PIXELS):
        raise ValueError(f"the plane would have {width} x {height} pixels; up to {MOST_PIXELS} a side are shown: use a "
                         "larger spacing, or make the plane smaller")
    axes = to_world[:3, :3] / np.linalg.norm(to_world[:3, :3], axis=0)
    pose = np.eye(4)
    pose[:3, :3] = spacing * axes
    pose[:3, 3] = to_world[:3, 3] - pose[:3, :3] @ [0.5 * (width - 1), 0.5 * (height - 1), 0]
    return pose, width, height


class BigusPlane(ScriptedLoadableModule):
    def __init__(self, parent):
        ScriptedLoadableModule.__init__(self, parent)
        parent.title = "BIGUS Plane"
        parent.categories = ["Ultrasound.BIGUS"]
        parent.contributors = ["BIGUS authors"]
        parent.helpText = "Shows a field of Gaussians, trained on a tracked sweep, at a plane markup while it is moved."


class BigusPlaneLogic(ScriptedLoadableModuleLogic):
    """What the panel does, without the panel."""

    def __init__(self):
        ScriptedLoadableModuleLogic.__init__(self)
        self.field = None

    def load(self, path):
        """Reads a field that `bigus train` or BigusTrain wrote. Its world is taken for RAS, as Slicer takes a sweep's."""
        import bigus  # here, so that the panel opens and can offer to install it

        self.field = bigus.read(path)

    def render(self, pose, width, height):
        """What the field shows: float32 [height, width], 0 to 1."""
        import bigus

        return bigus.reslice(self.field, pose, size=(width, height))

    def show(self, plane, volume, spacing):
        """Fills `volume`, a vtkMRMLScalarVolumeNode, with the slice at `plane`, a vtkMRMLMarkupsPlaneNode."""
        matrix = vtk.vtkMatrix4x4()
        plane.GetObjectToWorldMatrix(matrix)
        to_world = np.array([[matrix.GetElement(row, column) for column in range(4)] for row in range(4)])
        pose, width, height = plane_grid(to_world, plane.GetSizeWorld(), spacing)
        grey = (255 * self.render(pose, width, height) + 0.5).astype(np.uint8)  # fewer bytes to show than float
        slicer.util.updateVolumeFromArray(volume, grey[np.newaxis])
        matrix.DeepCopy(pose.ravel())
        volume.SetIJKToRASMatrix(matrix)


class BigusPlaneWidget(ScriptedLoadableModuleWidget, VTKObservationMixin):
    def __init__(self, parent=None):
        ScriptedLoadableModuleWidget.__init__(self, parent)
        VTKObservationMixin.__init__(self)

    def setup(self):
        ScriptedLoadableModuleWidget.setup(self)
        self.logic, self.plane, self.volume = BigusPlaneLogic(), None, None
        form = qt.QFormLayout()
        self.layout.addLayout(form)

        self.install = qt.QPushButton("Install bigus from a file ...")
        self.install.toolTip = "Installs a wheel (bigus-*.whl, made by 'pip wheel .' in the project) into Slicer's Python"
        form.addRow(self.install)
        self.path = ctk.ctkPathLineEdit()
        self.path.nameFilters = ["Fields (*.vtp *.ply)"]
        form.addRow("Field", self.path)
        self.selector = slicer.qMRMLNodeComboBox()
        self.selector.nodeTypes = ["vtkMRMLMarkupsPlaneNode"]
        self.selector.addEnabled = self.selector.renameEnabled = True
        self.selector.noneEnabled = True
        self.selector.setMRMLScene(slicer.mrmlScene)
        form.addRow("Plane", self.selector)
        self.spacing = qt.QDoubleSpinBox()
        self.spacing.setRange(0.05, 10)
        self.spacing.singleStep, self.spacing.value, self.spacing.suffix = 0.05, 0.3, " mm"
        form.addRow("Pixels", self.spacing)
        self.message = qt.QLabel()
        self.message.wordWrap = True
        form.addRow(self.message)
        self.layout.addStretch(1)

        # Many moves before one picture is drawn make one picture.
        self.timer = qt.QTimer()
        self.timer.singleShot = True
        self.timer.connect("timeout()", self.draw)
        self.install.connect("clicked()", self.on_install)
        self.path.connect("currentPathChanged(QString)", self.on_path)
        self.selector.connect("currentNodeChanged(vtkMRMLNode*)", self.on_plane)
        self.spacing.connect("valueChanged(double)", lambda value: self.timer.start(0))

    def cleanup(self):
        self.timer.stop()
        self.removeObservers()

    def attempt(self, work):
        """Runs `work`. What goes wrong is said in the panel."""
        try:
            self.message.text = work() or ""
        except ImportError as error:
            self.message.text = f"{error}. Install bigus from the wheel that 'pip wheel .' makes in the project."
        except Exception as error:
            self.message.text = str(error)

    def on_install(self):
        # Never by name: the package is in no index, where anybody could take the name.
        wheel = qt.QFileDialog.getOpenFileName(None, "The wheel of bigus", "", "Wheels (*.whl)")
        if wheel:
            self.attempt(lambda: slicer.util.pip_install([str(wheel)]))

    def on_path(self, path):
        self.attempt(lambda: self.logic.load(path))
        self.timer.start(0)

    def on_plane(self, plane):
        self.removeObservers()
        self.plane = plane
        if plane:
            for event in (slicer.vtkMRMLMarkupsNode.PointModifiedEvent, slicer.vtkMRMLTransformableNode.TransformModifiedEvent):
                self.addObserver(plane, event, lambda caller, event: self.timer.start(0))
            self.timer.start(0)

    def draw(self):
        if self.plane is None or self.logic.field is None or self.plane.GetNumberOfControlPoints() == 0:
            return
        if self.volume is None or not slicer.mrmlScene.IsNodePresent(self.volume):
            self.volume = slicer.mrmlScene.AddNewNodeByClass("vtkMRMLScalarVolumeNode", "BIGUS slice")
            self.volume.CreateDefaultDisplayNodes()
            slicer.util.setSliceViewerLayers(foreground=self.volume, foregroundOpacity=1)
        self.attempt(lambda: self.logic.show(self.plane, self.volume, self.spacing.value))
