// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// A JSON object read field by field: what nobody asked for is an error, so a misspelt option cannot pass
// unnoticed.
#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <set>
#include <string>

#include "Core/Model/Error.h"

class JobFields
{
public:
  /// `where` names the object in errors, such as "method".
  JobFields(const nlohmann::json& object, const std::string& where) : object_(object), where_(where)
  {
    if (!object.is_object())
    {
      throw bigus::Error(where + " must be a JSON object, but is " + object.dump() + ".");
    }
  }

  bool Has(const std::string& name) const { return object_.contains(name); }

  /// The object under a name, to be read by fields of its own.
  const nlohmann::json& Object(const std::string& name)
  {
    read_.insert(name);
    if (!Has(name))
    {
      throw bigus::Error(where_ + " lacks '" + name + "'.");
    }
    return object_.at(name);
  }

  template <class T>
  T Required(const std::string& name)
  {
    return Convert<T>(name, Object(name));
  }

  /// Leaves `value` as it is when the field is not there, or null.
  template <class T>
  void Read(const std::string& name, T& value)
  {
    read_.insert(name);
    if (Has(name) && !object_.at(name).is_null())
    {
      value = Convert<T>(name, object_.at(name));
    }
  }

  template <class T>
  void Read(const std::string& name, std::optional<T>& value)
  {
    T given{};
    read_.insert(name);
    if (Has(name) && !object_.at(name).is_null())
    {
      Read(name, given);
      value = given;
    }
  }

  /// Throws Error when there is a field that was never read.
  void Done() const
  {
    for (const auto& item : object_.items())
    {
      if (read_.count(item.key()) == 0)
      {
        throw bigus::Error(where_ + " has no option '" + item.key() + "'.");
      }
    }
  }

private:
  template <class T>
  T Convert(const std::string& name, const nlohmann::json& value) const
  {
    try
    {
      return value.get<T>();
    }
    catch (const nlohmann::json::exception&)
    {
      throw bigus::Error(where_ + ": '" + name + "' cannot be " + value.dump() + ".");
    }
  }

  const nlohmann::json& object_;
  std::string where_;
  std::set<std::string> read_;
};
