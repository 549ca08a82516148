#include "Engine.h"

#include <algorithm>
#include <utility>

#include "Error.h"

namespace bigus
{

std::unique_ptr<Engine> CreateReferenceEngine();
std::unique_ptr<Engine> CreateCpuEngine();
std::unique_ptr<Engine> CreateCpuDoubleEngine();

namespace
{

using Entry = std::pair<std::string, Engine::Factory>;

std::vector<Entry>& Registry()
{
  static std::vector<Entry> entries{{"cpu", CreateCpuEngine}, {"cpu-double", CreateCpuDoubleEngine}, {"reference", CreateReferenceEngine}};
  return entries;
}

}  // namespace

std::unique_ptr<Engine> Engine::Create(const std::string& name)
{
  const std::vector<Entry>& entries = Registry();
  const auto found = name == "auto"
                         ? entries.begin()
                         : std::find_if(entries.begin(), entries.end(),
                                        [&name](const Entry& entry) { return entry.first == name; });
  if (found == entries.end())
  {
    std::string names = "auto";
    for (const Entry& entry : entries)
    {
      names += ", " + entry.first;
    }
    throw Error("There is no engine named '" + name + "'. Available: " + names + ".");
  }
  return found->second();
}

void Engine::Register(const std::string& name, Factory factory, bool preferred)
{
  std::vector<Entry>& entries = Registry();
  entries.insert(preferred ? entries.begin() : entries.end(), {name, std::move(factory)});
}

std::vector<std::string> Engine::Names()
{
  std::vector<std::string> names;
  for (const Entry& entry : Registry())
  {
    names.push_back(entry.first);
  }
  return names;
}

}  // namespace bigus
