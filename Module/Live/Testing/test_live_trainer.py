# SPDX-FileCopyrightText: BIGUS authors
# SPDX-License-Identifier: BSD-3-Clause
"""vtkBigusLiveTrainer by the name that it has in both packages: VTK's wrapped C++ class, or pure Python over the wheel."""

import pathlib
import sys
import time
import unittest

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[3] / "Testing" / "Python"))
from test_filters import matrix, numbers, phantom, pixels  # which skips where there is no package vtk

import bigus
import numpy as np
from vtkmodules.util.numpy_support import numpy_to_vtk
from vtkmodules.vtkCommonDataModel import vtkImageData
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline


class LiveTrainer(unittest.TestCase):
    def setUp(self):
        self.sweep = bigus.update(phantom(NumberOfFrames=20)).GetOutputDataObject(0)
        self.poses = numbers(self.sweep.GetFieldData(), "ImageToReference").reshape(-1, 4, 4)
        self.live = bigus.vtkBigusLiveTrainer()
        self.live.SetEngine("cpu")

    def frame(self, k):
        image = vtkImageData()
        width, height, _ = self.sweep.GetDimensions()
        image.SetDimensions(width, height, 1)
        image.GetPointData().SetScalars(numpy_to_vtk(pixels(self.sweep)[k].ravel(), deep=True))
        return image

    def is_finished(self):
        lines = self.live.GetOutput().GetFieldData().GetAbstractArray("Provenance")
        return lines is not None and "filter=vtkBigusLiveTrainer" in [lines.GetValue(k) for k in range(lines.GetNumberOfValues())]

    def test_frames_one_by_one_a_slice_and_a_finished_field(self):
        for k in range(20):
            self.assertTrue(self.live.AddFrame(self.frame(k), matrix(self.poses[k]), 0.05 * k))
        while self.live.GetNumberOfFrames() < 20:
            time.sleep(0.01)
        self.assertEqual((self.live.GetNumberOfRefusedFrames(), self.live.GetNumberOfWaitingFrames()), (0, 0))
        self.live.SetFinishTime(20)  # ends when all its steps are taken
        told = []
        self.live.AddObserver("ProgressEvent", lambda *_: told.append(self.live.GetProgress()))
        bigus.update(self.live)
        self.assertTrue(self.is_finished() and len(told) > 2)
        slice, truth = vtkImageData(), pixels(self.sweep)[10] / 255
        self.assertTrue(self.live.RenderSlice(matrix(self.poses[10]), *self.sweep.GetDimensions()[:2], slice))
        self.assertGreater(np.corrcoef(pixels(slice)[0].ravel(), truth.ravel())[0, 1], 0.8)
        np.testing.assert_allclose(slice.GetOrigin(), self.poses[10][:3, 3])
        np.testing.assert_allclose(slice.GetSpacing()[:2], np.linalg.norm(self.poses[10][:3, :2], axis=0))

    def test_a_connected_sweep_is_handed_over_up_to_the_time_asked_for(self):
        times = numbers(self.sweep.GetFieldData(), "Timestamp")
        self.live.SetFinishTime(5)
        self.live.SetInputDataObject(0, self.sweep)
        self.live.UpdateInformation()
        steps = self.live.GetOutputInformation(0).Get(vtkStreamingDemandDrivenPipeline.TIME_STEPS())
        np.testing.assert_array_equal(steps, times)
        for step, frames, finished in ((11, 12, False), (19, 20, True), (9, 10, False)):
            self.live.UpdateTimeStep(times[step])
            self.assertEqual((self.live.GetNumberOfFrames(), self.is_finished()), (frames, finished))
            self.assertGreater(self.live.GetOutput().GetNumberOfPoints(), 0)
        whole = bigus.vtkBigusLiveTrainer()
        whole.SetInputDataObject(0, self.sweep)
        bigus.update(whole)
        self.assertEqual((whole.GetNumberOfFrames(), whole.GetNumberOfDroppedFrames()), (20, 0))

    def test_what_is_no_frame_is_an_error_and_an_abort_keeps_the_field(self):
        said = []
        self.live.AddObserver("ErrorEvent", lambda *_: said.append(1))
        self.assertFalse(self.live.AddFrame(self.sweep, matrix(self.poses[0]), 0))  # 20 slices
        self.assertFalse(self.live.AddFrame(self.frame(0), None, 0))
        self.assertFalse(self.live.RenderSlice(None, 8, 8, vtkImageData()))
        self.assertEqual(len(said), 3)
        self.assertTrue(self.live.AddSweep(self.sweep))
        self.assertTrue(self.live.AddSweep(self.sweep))  # its times are over
        self.assertEqual(self.live.GetNumberOfPassedOverFrames(), 20)
        self.live.AddObserver("ProgressEvent", lambda *_: self.live.SetAbortExecute(1))
        self.live.SetFinishTime(600)
        begun = time.monotonic()
        self.live.Update()
        self.assertLess(time.monotonic() - begun, 60)
        self.assertGreater(self.live.GetOutput().GetNumberOfPoints(), 0)
        self.live.Reset()
        self.assertEqual((self.live.GetNumberOfFrames(), self.live.GetLastRefusal()), (0, ""))


if __name__ == "__main__":
    unittest.main()
