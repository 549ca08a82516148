// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// What is linked into fuzz-seeds may write seeds of its own.
#pragma once

#include <cstddef>
#include <string>

namespace bigus::fuzz
{

/// Writes a small file from which the fuzzing of `target` starts.
void Seed(const std::string& target, const std::string& name, const std::string& bytes);

/// `write` is called by main and calls Seed. To be called before main begins; returns how many were added.
std::size_t AddSeeds(void (*write)());

}  // namespace bigus::fuzz
