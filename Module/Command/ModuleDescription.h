// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// A subcommand as 3D Slicer runs it: its options described in XML, and arguments as Slicer writes them.
#pragma once

#include <string>
#include <vector>

namespace CLI
{
class App;
}

namespace bigus::command
{

/// "train" of a program called as ".../BigusTrain"; empty where the name is no module's.
std::string ModuleCommand(const std::string& program);

/// The SlicerExecutionModel's XML of the subcommand `command` of `program`: every option as the subcommand declares it
/// (flags whose help begins "Short for" only repeat another one and are left out), and of the program's own options those
/// that say how to compute.
std::string DescribeModule(const CLI::App& program, const CLI::App& command);

/// Arguments of a module as the program takes them: "--hold_out" to "--hold-out", because names in the XML may hold
/// underscores but no hyphens. "--more a,b", which may be there repeatedly, to a and b at the end, where the subcommand has
/// a list of files MORE. Other values stay as they are.
std::vector<std::string> ModuleArguments(const CLI::App& command, int argumentCount, char** arguments);

}  // namespace bigus::command
