// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What the fuzz targets share. A target's bytes become a file, the program's own code reads it, and its own error path
// tells what was wrong.
#pragma once

#include <functional>
#include <string>
#include <vector>

#include "Console.h"
#include "Exit.h"
#include "Inputs.h"

namespace bigus::fuzz
{

/// What a target does with the bytes of one input. Each target defines it.
void TryInput(const std::string& bytes);

/// A path in a folder of this process, in memory where the system has such a folder.
std::string PathOf(const std::string& name);

/// Writes `bytes` to PathOf(name) and returns the path.
std::string Write(const std::string& name, const std::string& bytes);

/// What a job said on stdout, and why it refused its input; empty: it did not.
struct Said
{
  std::string answer, refusal;
};

/// Runs the job as main does, its output caught. Ends the process, which the fuzzer takes for a finding, unless the job
/// succeeds or is refused as bad input with one message of bounded length and valid JSON.
Said RunAsProgram(const std::function<command::ExitCode(command::Console&)>& job);

/// The same for `bigus info PATH`, with further arguments.
Said RunInfo(const std::string& path, const std::vector<std::string>& arguments = {});

/// `bigus info`, then what has poses with its pixels as `check` reads it, which inspects the sweep; what has none, or whose
/// poses are refused, as `metrics` reads it. Where there is no answer at all the header was refused by the parser that all
/// share, with and without poses. `config`: a Plus configuration; empty: none. Returns what `bigus info` said.
Said ReadAsSequence(const std::string& path, const std::string& config = {});

/// Reads planes as `slice` does, and renders a few of them.
void ReadAsPlanes(const command::PlaneOptions& options);

/// Says what is wrong and ends the process.
[[noreturn]] void Finding(const std::string& what);

}  // namespace bigus::fuzz
