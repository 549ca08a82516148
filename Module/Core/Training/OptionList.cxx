// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Training/OptionList.h"

#include <array>
#include <cctype>
#include <charconv>
#include <cmath>
#include <optional>
#include <type_traits>
#include <utility>

#include "Core/Model/Error.h"

namespace bigus
{
namespace
{

const std::string kOpen = "auto";

constexpr std::array<std::pair<const char*, SeedPlacement>, 3> kPlacements{
    {{"intensity", SeedPlacement::Intensity}, {"harris", SeedPlacement::Harris}, {"random", SeedPlacement::Random}}};
constexpr std::array<std::pair<const char*, Preset>, 2> kPresets{
    {{"fidelity", Preset::Fidelity}, {"texture", Preset::Texture}}};
constexpr std::array<std::pair<const char*, bool>, 2> kSwitch{{{"on", true}, {"off", false}}};

/// The names of a type's values; null for a type without such names.
template <class T>
constexpr auto Names()
{
  if constexpr (std::is_same_v<T, bool>)
  {
    return &kSwitch;
  }
  else if constexpr (std::is_same_v<T, SeedPlacement>)
  {
    return &kPlacements;
  }
  else if constexpr (std::is_same_v<T, Preset>)
  {
    return &kPresets;
  }
  else
  {
    return nullptr;
  }
}

template <class T>
constexpr bool kHasNames = !std::is_same_v<decltype(Names<T>()), std::nullptr_t>;
template <class T>
constexpr bool kIsNumber = std::is_arithmetic_v<T> && !std::is_same_v<T, bool>;

template <class T>
struct Value
{
  using Type = T;
  static constexpr bool mayBeOpen = false;
};
template <class T>
struct Value<std::optional<T>>
{
  using Type = T;
  static constexpr bool mayBeOpen = true;
};

template <class T>
std::string TextOf(const T& value)
{
  if constexpr (Value<T>::mayBeOpen)
  {
    return value ? TextOf(*value) : kOpen;
  }
  else if constexpr (kHasNames<T>)
  {
    for (const auto& [name, named] : *Names<T>())
    {
      if (named == value)
      {
        return name;
      }
    }
    return "";
  }
  else if constexpr (kIsNumber<T>)
  {
    return NumberText(static_cast<double>(value));
  }
  else if constexpr (std::is_same_v<T, std::string>)
  {
    return value;
  }
  else
  {
    return value.ToString();
  }
}

/// What an option of this type may be, apart from open.
template <class T>
std::string ValuesOf(const OptionInfo& info)
{
  if constexpr (kIsNumber<T>)
  {
    return (info.zeroIsNone ? "0 or " : "") + NumberText(info.least) + " to " + NumberText(info.most) +
           (*info.unit ? " " : "") + info.unit;
  }
  else if constexpr (kHasNames<T>)
  {
    std::string values;
    for (const auto& [name, named] : *Names<T>())
    {
      values += (values.empty() ? "" : "|") + std::string(name);
    }
    return values;
  }
  else
  {
    return std::is_same_v<T, FrameInterpolation> ? "normals|probe[+flow][+rough|+smooth]"
           : std::is_same_v<T, KeptKinds>        ? KeptKinds::kNames
                                                 : "";
  }
}

[[noreturn]] void Refuse(const OptionInfo& info, const std::string& value, const std::string& values)
{
  throw Error(SpellOption(info.name) + " is " + value.substr(0, 60) + "; it must be " + values + ".");
}

bool IsInRange(const OptionInfo& info, double value)  // false for NaN
{
  return (value >= info.least && value <= info.most) || (info.zeroIsNone && value == 0);
}

template <class T>
void Check(const OptionInfo& info, const T& value)
{
  if constexpr (Value<T>::mayBeOpen)
  {
    if (value)
    {
      Check(info, *value);
    }
  }
  else if constexpr (kIsNumber<T>)
  {
    if (!IsInRange(info, static_cast<double>(value)))
    {
      Refuse(info, NumberText(static_cast<double>(value)), ValuesOf<T>(info));
    }
  }
  else if constexpr (std::is_same_v<T, Loss>)
  {
    value.Validate();
  }
}

template <class T>
T Parse(const OptionInfo& info, const std::string& text, bool mayBeOpen)
{
  const std::string values = ValuesOf<T>(info) + (mayBeOpen ? " or " + kOpen : "");
  if constexpr (kHasNames<T>)
  {
    for (const auto& [name, named] : *Names<T>())
    {
      if (text == name)
      {
        return named;
      }
    }
    Refuse(info, "'" + text + "'", values);
  }
  else if constexpr (kIsNumber<T>)
  {
    double number = 0;
    const auto [end, fault] = std::from_chars(text.data(), text.data() + text.size(), number);
    if (fault != std::errc() || end != text.data() + text.size() || !IsInRange(info, number) ||
        (std::is_integral_v<T> && number != std::floor(number)))
    {
      Refuse(info, text.empty() ? "''" : text, values);
    }
    return static_cast<T>(number);
  }
  else if constexpr (std::is_same_v<T, std::string>)
  {
    return text;
  }
  else
  {
    try
    {
      return T::Parse(text);
    }
    catch (const Error& error)
    {
      throw Error(SpellOption(info.name) + ": " + error.what());
    }
  }
}

}  // namespace

std::string NumberText(double value)
{
  char text[32];
  const bool plain = std::abs(value) < 1e16 && (value == std::floor(value) || std::abs(value) >= 1e-5);
  char* const end = plain ? std::to_chars(text, text + sizeof text, value, std::chars_format::fixed).ptr
                          : std::to_chars(text, text + sizeof text, value).ptr;
  return {text, end};
}

void TrainerOptions::Validate() const
{
  ForEachOption(*this, [](const OptionInfo& info, const auto& value) { Check(info, value); });
}

std::vector<OptionText> ListOptions(const TrainerOptions& options)
{
  std::vector<OptionText> list;
  ForEachOption(options,
                [&list](const OptionInfo& info, const auto& value)
                {
                  using T = std::decay_t<decltype(value)>;
                  using Inner = typename Value<T>::Type;
                  const OptionText::Kind kind = std::is_same_v<Inner, bool> ? OptionText::Kind::Switch
                                                : kIsNumber<Inner>          ? OptionText::Kind::Number
                                                                            : OptionText::Kind::Text;
                  list.push_back({info, kind, Value<T>::mayBeOpen, ValuesOf<Inner>(info), TextOf(value),
                                  kIsNumber<Inner> && std::is_integral_v<Inner>});
                });
  return list;
}

void SetOption(TrainerOptions& options, const std::string& name, const std::string& text)
{
  bool found = false;
  ForEachOption(options,
                [&](const OptionInfo& info, auto& value)
                {
                  if (name != info.name)
                  {
                    return;
                  }
                  found = true;
                  using T = std::decay_t<decltype(value)>;
                  if constexpr (Value<T>::mayBeOpen)
                  {
                    value = text == kOpen ? std::nullopt : T(Parse<typename Value<T>::Type>(info, text, true));
                  }
                  else
                  {
                    value = Parse<T>(info, text, false);
                  }
                });
  Require(found, "There is no option '", name.substr(0, 60), "' of the trainer.");
}

std::string SpellOption(const std::string& name, char separator)
{
  std::string spelled;
  for (const char letter : name)
  {
    const bool upper = std::isupper(static_cast<unsigned char>(letter)) != 0;
    spelled += upper && !spelled.empty() ? std::string(1, separator) : "";
    spelled += upper ? static_cast<char>(std::tolower(static_cast<unsigned char>(letter))) : letter;
  }
  return spelled;
}

}  // namespace bigus
