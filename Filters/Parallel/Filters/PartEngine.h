// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// An engine of several processes, each of which holds and trains a part of the field.
#pragma once

#include <memory>
#include <string>

#include "Core/Engine/Engine.h"

namespace bigus
{

/// The engine `name` ("auto": "cpu") for this process's part. All processes make the same calls with the same arguments,
/// SetField with the whole field, and get the same answers with the same bits, GetField the whole field; MemoryUse is this
/// process's own, and so is a state, which holds its part. What is left out of a Render is bounded for the sum. `exchange` must
/// outlive the engine.
std::unique_ptr<Engine> CreatePartEngine(const std::string& name, Exchange& exchange);

}  // namespace bigus
