// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Running VTK algorithms from the command line: their errors become exceptions, their progress the bar, and
// an interruption an abort.
#pragma once

#include <string>

class vtkAlgorithm;

namespace bigus::command
{

class Console;

/// From here on VTK's error messages are kept for Update, and its warnings become single lines on stderr.
void CatchVtkMessages(Console& console);

/// The share of a job that one of several updates does, counted from 0.
struct Part
{
  int index = 0, count = 1;
};

/// Updates `algorithm` and all it depends on, with a bar named `job`. Throws Error with the first message of any algorithm
/// that failed, Interrupted after SIGINT.
void Update(vtkAlgorithm* algorithm, Console& console, const std::string& job, Part part = {});

/// Throws Error with what VTK said unless `done`: for what algorithms offer outside their update.
void RequireDone(bool done);

/// As Update, for an algorithm that keeps what it has when it is stopped: an interruption ends it early and is no fault.
void UpdateUntilInterrupted(vtkAlgorithm* algorithm, Console& console, const std::string& job);

/// Only what the algorithm says before it makes its output (UpdateInformation).
void UpdateInformation(vtkAlgorithm* algorithm);

/// As Update, for a writer: failures are OutputErrors, and an interruption does not stop it.
void Write(vtkAlgorithm* writer, Console& console, const std::string& job);

}  // namespace bigus::command
