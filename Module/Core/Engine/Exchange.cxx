// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Engine/Exchange.h"

#include "Core/Engine/Engine.h"

namespace bigus
{

Exchange& Exchange::Alone()
{
  static Exchange alone;
  return alone;
}

std::unique_ptr<Engine> Exchange::CreateEngine(const std::string& name)
{
  return Engine::Create(name);
}

}  // namespace bigus
