// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// bigus._core: Core for Python, without VTK.
#include <vector>

#include "Arrays.h"
#include "Core/Engine/Engine.h"
#include "Core/Engine/InstructionSets.h"
#include "Core/Model/Error.h"

namespace
{

std::vector<void (*)(nb::module_&)>& Bindings()
{
  static std::vector<void (*)(nb::module_&)> bindings;
  return bindings;
}

}  // namespace

std::size_t bigus::AddBinding(void (*bind)(nb::module_&))
{
  Bindings().push_back(bind);
  return Bindings().size();
}

NB_MODULE(_core, m)
{
  m.doc() = "The compiled part of bigus.";
  m.attr("__version__") = BIGUS_VERSION;
  nb::set_leak_warnings(false);  // at its end Python lets go of globals after nanobind has looked
  static PyObject* const error = PyErr_NewExceptionWithDoc(
      "bigus._core.Error", "What a caller got wrong, or a file. The text names what was found and what to do.",
      PyExc_RuntimeError, nullptr);
  m.attr("Error") = nb::borrow(error);
  nb::register_exception_translator(
      [](const std::exception_ptr& thrown, void*)
      {
        try
        {
          std::rethrow_exception(thrown);
        }
        catch (const bigus::Error& caught)
        {
          PyErr_SetObject(error, bigus::ToText(caught.what()).ptr());
        }
      });
  bigus::BindSweep(m);
  bigus::BindField(m);
  bigus::BindFiles(m);
  bigus::BindTraining(m);
  bigus::BindSlices(m);
  bigus::BindPhantom(m);
  m.attr("added_filters") = nb::dict();
  for (const auto bind : Bindings())
  {
    bind(m);
  }
  m.def("engines", &bigus::Engine::Names, "Names of what can compute here, the preferred first.");
  m.def("missing_engines", &bigus::Engine::Missing, "Pairs of an engine that cannot be used here, and why.");
  m.def("instruction_sets", &bigus::InstructionSets,
        "Instruction sets of this processor that are compiled in; the first is in use.");
  m.def("use_instruction_set", &bigus::UseInstructionSet, "name"_a,
        "No better one is used from now on. Call it before anything is trained or rendered.");
}
