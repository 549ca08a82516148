// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// Which instructions of the processor the CPU engines use. Results have the same bits for any number of threads, but not
// for any instruction set, because each adds in an order of its own.
#pragma once

#include <string>
#include <vector>

namespace bigus
{

/// Names of the instruction sets that are compiled in and that this processor has, the best first: AVX-512, AVX2, SSE4,
/// SSSE3, NEON, SCALAR and their variants. The first is in use.
std::vector<std::string> InstructionSets();

/// From now on no better one than `name` is used, in the whole program. Call it before the first engine is made. Throws
/// Error, with the names there are.
///
/// Without such a call the environment variable BIGUS_SIMD decides when the first engine is made.
void UseInstructionSet(const std::string& name);

/// What the environment variable asks for, once. Engine::Create calls it.
void UseInstructionSetOfEnvironment();

}  // namespace bigus
