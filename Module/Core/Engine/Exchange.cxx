// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Engine/Exchange.h"

#include <utility>

#include "Core/Engine/Engine.h"

namespace bigus
{

Exchange& Exchange::Alone()
{
  static Exchange alone;
  return alone;
}

std::vector<std::string> Exchange::Gather(std::string mine)
{
  std::vector<std::string> all;
  all.push_back(std::move(mine));  // a state may be as large as the field
  return all;
}

std::unique_ptr<Engine> Exchange::CreateEngine(const std::string& name)
{
  return Engine::Create(name);
}

}  // namespace bigus
