// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Progress of Core's work for a Python function, while the work runs without Python's lock.
#pragma once

#include <exception>

#include "Arrays.h"

namespace bigus
{

/// Calls `function`, unless that is None, with a fraction or more facts, and asks for signals. Work goes on until the function
/// returns False, Ctrl-C is pressed or the function raises.
class PythonProgress
{
public:
  explicit PythonProgress(nb::object function) : function_(std::move(function)) {}

  /// False: stop. Takes Python's lock.
  template <class... Facts>
  bool operator()(const Facts&... facts)
  {
    const nb::gil_scoped_acquire lock;
    try
    {
      if (PyErr_CheckSignals() != 0)
      {
        throw nb::python_error();
      }
      return function_.is_none() || !function_(facts...).is(nb::bool_(false));
    }
    catch (const nb::python_error&)
    {
      raised_ = std::current_exception();
      return false;
    }
  }

  /// Raises what ended the work, if Ctrl-C or the function did. With Python's lock held.
  void Rethrow()
  {
    if (raised_)
    {
      std::rethrow_exception(std::exchange(raised_, nullptr));
    }
  }

private:
  nb::object function_;
  std::exception_ptr raised_;
};

/// What `work(progress)` gives, done while other threads of Python run. Raises what ended it, if Ctrl-C or `function` did.
template <class Work>
auto WorkAlone(const nb::object& function, const Work& work)
{
  PythonProgress progress(function);
  auto result = [&]
  {
    const nb::gil_scoped_release others;
    return work(progress);
  }();
  progress.Rethrow();
  return result;
}

}  // namespace bigus
