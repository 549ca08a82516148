// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The module bigus._update: vtkAlgorithm::Update() without Python's lock, which VTK's own wrapping keeps for the whole call,
// files of checkpoints, because a trainer takes its checkpoints as functions of C++, and the choice of instructions.
// Python's header comes before every other.
// clang-format off
#include "vtkPython.h"
// clang-format on

#include <exception>
#include <memory>

#include "Core/Engine/InstructionSets.h"
#include "Core/Trainer/Trainer.h"
#include "IO/CheckpointFile.h"
#include "vtkAlgorithm.h"
#include "vtkBigusTrainer.h"
#include "vtkPythonUtil.h"
#include "vtkSmartPointer.h"
#include "vtkSmartPyObject.h"

namespace
{

/// Python's lock is let go of while this lives.
struct Unlocked
{
  PyThreadState* const state = PyEval_SaveThread();
  ~Unlocked() { PyEval_RestoreThread(state); }
};

/// None; what `work` throws becomes RuntimeError.
template <class Work>
PyObject* Run(const Work& work)
{
  try
  {
    work();
  }
  catch (const std::exception& error)
  {
    PyErr_SetString(PyExc_RuntimeError, error.what());
    return nullptr;
  }
  Py_RETURN_NONE;
}

PyObject* Update(PyObject*, PyObject* object)
{
  vtkSmartPointer<vtkAlgorithm> algorithm =
      vtkAlgorithm::SafeDownCast(vtkPythonUtil::GetPointerFromObject(object, "vtkAlgorithm"));
  if (!algorithm)
  {
    if (!PyErr_Occurred())
    {
      PyErr_SetString(PyExc_TypeError, "a vtkAlgorithm is expected");
    }
    return nullptr;
  }
  return Run(
      [&algorithm]
      {
        const Unlocked others;
        algorithm->Update();
      });
}

PyObject* KeepCheckpoints(PyObject*, PyObject* arguments)
{
  PyObject* object = nullptr;
  const char* path = nullptr;
  double interval = 0;
  int resumes = 0;
  if (!PyArg_ParseTuple(arguments, "Osdp", &object, &path, &interval, &resumes))
  {
    return nullptr;
  }
  vtkBigusTrainer* const trainer =
      vtkBigusTrainer::SafeDownCast(vtkPythonUtil::GetPointerFromObject(object, "vtkBigusTrainer"));
  if (!trainer)
  {
    return nullptr;
  }
  return Run(
      [=]
      {
        const auto file = std::make_shared<bigus::CheckpointFile>(
            path, [trainer](const std::string& what) { vtkWarningWithObjectMacro(trainer, << what); });
        bigus::Checkpoints checkpoints;
        checkpoints.interval = interval;
        checkpoints.save = [file](const std::string& state) { file->Write(state); };
        if (resumes && file->Exists())
        {
          checkpoints.resume = file->Read();
        }
        trainer->SetCheckpoints(checkpoints);
      });
}

PyObject* InstructionSets(PyObject*, PyObject*)
{
  std::string names;
  for (const std::string& name : bigus::InstructionSets())
  {
    names += name + ' ';
  }
  const vtkSmartPyObject text(PyUnicode_FromString(names.c_str()));
  return text.GetPointer() ? PyUnicode_Split(text, nullptr, -1) : nullptr;
}

PyObject* UseInstructionSet(PyObject*, PyObject* arguments)
{
  const char* name = nullptr;
  return PyArg_ParseTuple(arguments, "s", &name) ? Run([name] { bigus::UseInstructionSet(name); }) : nullptr;
}

PyMethodDef methods[] = {
    {"instruction_sets", InstructionSets, METH_NOARGS,
     "The instruction sets that this processor and the build have, the best first, which is in use."},
    {"use_instruction_set", UseInstructionSet, METH_VARARGS,
     "use_instruction_set(name): from now on no better instructions are used; call it before anything is computed. A "
     "field has the same bits again only with the set in its provenance."},
    {"update", Update, METH_O,
     "update(algorithm): updates it while other Python threads run. Observers take the lock for their calls. Neither "
     "the algorithm nor anything before it in its pipeline may be written in Python, because VTK calls such without it."},
    {"keep_checkpoints", KeepCheckpoints, METH_VARARGS,
     "keep_checkpoints(trainer, path, interval, resume): the trainer's next training keeps its state there"},
    {nullptr, nullptr, 0, nullptr}};

PyModuleDef definition = {PyModuleDef_HEAD_INIT, "_update", nullptr, -1, methods, nullptr, nullptr, nullptr, nullptr};

}  // namespace

PyMODINIT_FUNC PyInit__update()
{
  return PyModule_Create(&definition);
}
