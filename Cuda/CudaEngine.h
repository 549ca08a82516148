// The CUDA engine, for Engine::Register.
#pragma once

#include <memory>

#include "Core/Engine.h"

namespace bigus
{

/// On the first device. Throws Error when there is none.
std::unique_ptr<Engine> CreateCudaEngine();

}  // namespace bigus
