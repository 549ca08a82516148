// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Engine/Engine.h"

#if defined(__unix__)
#include <dlfcn.h>
#include <unistd.h>
#endif

#include <algorithm>
#include <utility>

#include "Core/Engine/Checks.h"
#include "Core/Engine/InstructionSets.h"
#include "Core/Model/Error.h"

namespace bigus
{

std::unique_ptr<Engine> CreateReferenceEngine();
std::unique_ptr<Engine> CreateCpuEngine();
std::unique_ptr<Engine> CreateCpuDoubleEngine();

namespace
{

using Entry = std::pair<std::string, Engine::Factory>;

/// The engines that are here, the preferred first, and why others are not.
struct Registry
{
  std::vector<Entry> entries{
      {"cpu", CreateCpuEngine}, {"cpu-double", CreateCpuDoubleEngine}, {"reference", CreateReferenceEngine}};
  std::vector<std::pair<std::string, std::string>> missing;
};

/// Loads the library of the CUDA engine, if it lies beside this one. Its one function is told this library's version. It
/// gives a factory and returns null, or returns why the engine cannot be used.
void LoadCuda(Registry& registry)
{
#if defined(__unix__)
  Dl_info here;
  if (dladdr(reinterpret_cast<const void*>(&CreateCpuEngine), &here) == 0 || !here.dli_fname)
  {
    return;
  }
  const std::string file = here.dli_fname;
  const std::string library = file.substr(0, file.find_last_of('/') + 1) + "libBIGUSCuda.so.1";
  const bool isThere = access(library.c_str(), F_OK) == 0;
  void* const handle = isThere ? dlopen(library.c_str(), RTLD_NOW | RTLD_LOCAL) : nullptr;
  using Function = const char* (*)(const char*, Engine::Factory*);
  const auto find = handle ? reinterpret_cast<Function>(dlsym(handle, "bigusCudaEngine")) : nullptr;
  Engine::Factory factory;
  const char* reason = find ? find(BIGUS_VERSION, &factory) : isThere ? dlerror() : "this build has no CUDA engine";
  if (reason)
  {
    registry.missing.emplace_back("cuda", reason);
    return;
  }
  registry.entries.insert(registry.entries.begin(), {"cuda", std::move(factory)});
#else
  registry.missing.emplace_back("cuda", "this system has no CUDA engine");
#endif
}

Registry& TheRegistry()
{
  static Registry registry = []
  {
    Registry fresh;
    LoadCuda(fresh);
    return fresh;
  }();
  return registry;
}

}  // namespace

std::unique_ptr<Engine> Engine::Create(const std::string& name)
{
  UseInstructionSetOfEnvironment();
  const Registry& registry = TheRegistry();
  if (name == "auto")
  {
    for (const Entry& entry : registry.entries)
    {
      try
      {
        return entry.second();
      }
      catch (const Error&)
      {
        // A device that others fill, say. The CPU always works.
      }
    }
  }
  const auto found = std::find_if(registry.entries.begin(), registry.entries.end(),
                                  [&name](const Entry& entry) { return entry.first == name; });
  if (found != registry.entries.end())
  {
    return found->second();
  }
  std::string names = "auto";
  for (const Entry& entry : registry.entries)
  {
    names += ", " + entry.first;
  }
  for (const auto& [engine, reason] : registry.missing)
  {
    if (engine == name)
    {
      throw Error("The engine '" + name + "' cannot be used here: " + reason + ". Available: " + names + ".");
    }
  }
  throw Error("There is no engine named '" + name + "'. Available: " + names + ".");
}

void Engine::Register(const std::string& name, Factory factory, bool preferred)
{
  std::vector<Entry>& entries = TheRegistry().entries;
  entries.insert(preferred ? entries.begin() : entries.end(), {name, std::move(factory)});
}

void Engine::RenderStack(const std::vector<SlicePlane>& planes, ViewOutput output, float* images, float* coverage)
{
  CheckStack(planes);
  for (const SlicePlane& plane : planes)
  {
    Render(plane, output, images, coverage);
    images += plane.NumberOfPixels();
    coverage = coverage ? coverage + plane.NumberOfPixels() : nullptr;
  }
}

std::vector<std::pair<std::string, std::string>> Engine::Missing()
{
  return TheRegistry().missing;
}

std::vector<std::string> Engine::Names()
{
  std::vector<std::string> names;
  for (const Entry& entry : TheRegistry().entries)
  {
    names.push_back(entry.first);
  }
  return names;
}

void Engine::SetExchange(Exchange*)
{
  throw Error("The engine " + Device() + " cannot train a part of a field; on several processes choose \"cpu\".");
}

void Engine::SaveState(StateWriter&) const
{
  throw Error("The engine " + Device() + " cannot save its state.");
}

void Engine::LoadState(StateReader&)
{
  throw Error("The engine " + Device() + " cannot load a state.");
}

}  // namespace bigus
