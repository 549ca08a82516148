// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The CUDA engine, for Engine::Register.
#pragma once

#include <memory>

#include "Core/Engine/Engine.h"

namespace bigus
{

/// On the first device. Throws Error when there is none.
std::unique_ptr<Engine> CreateCudaEngine();

}  // namespace bigus
