// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Engine/Loss.h"

#include <array>
#include <cctype>
#include <charconv>
#include <string_view>

#include "Core/Model/Error.h"
#include "Core/Numerics/Format.h"

namespace bigus
{
namespace
{

struct Term
{
  const char* name;
  double Loss::*weight;
};
constexpr std::array<Term, 5> terms{{{"l1", &Loss::l1},
                                     {"l2", &Loss::l2},
                                     {"dssim", &Loss::dssim},
                                     {"ffl", &Loss::ffl},
                                     {"contrast", &Loss::contrast}}};
constexpr double kLargestWeight = 1e6;

/// Text fit for a message: not long, nothing unprintable.
std::string Quoted(std::string_view text)
{
  constexpr std::size_t kLongest = 60;
  std::string quoted = "\"";
  for (const char c : text.substr(0, kLongest))
  {
    quoted += std::isprint(static_cast<unsigned char>(c)) ? c : '?';
  }
  return quoted + (text.size() > kLongest ? "...\"" : "\"");
}

/// Reads a text from its front.
class Reader
{
public:
  explicit Reader(std::string_view text) : rest_(text) { SkipBlanks(); }

  bool AtEnd() const { return rest_.empty(); }

  bool Take(char c)
  {
    const bool found = !rest_.empty() && rest_.front() == c;
    if (found)
    {
      rest_.remove_prefix(1);
      SkipBlanks();
    }
    return found;
  }

  bool TakeNumber(double& value)
  {
    const auto [end, error] = std::from_chars(rest_.data(), rest_.data() + rest_.size(), value);
    if (error != std::errc())
    {
      return false;
    }
    rest_.remove_prefix(end - rest_.data());
    SkipBlanks();
    return true;
  }

  /// The letters and digits that follow, in lower case.
  std::string TakeName()
  {
    std::string name;
    while (!rest_.empty() && std::isalnum(static_cast<unsigned char>(rest_.front())))
    {
      name += static_cast<char>(std::tolower(static_cast<unsigned char>(rest_.front())));
      rest_.remove_prefix(1);
    }
    SkipBlanks();
    return name;
  }

private:
  void SkipBlanks()
  {
    const std::size_t first = rest_.find_first_not_of(" \t");
    rest_.remove_prefix(first == std::string_view::npos ? rest_.size() : first);
  }

  std::string_view rest_;
};

}  // namespace

void Loss::Validate() const
{
  double sum = 0;
  for (const Term& term : terms)
  {
    const double weight = this->*term.weight;
    Require(weight >= 0 && weight <= kLargestWeight, "Loss: the weight of ", term.name, " is ", ExactNumber(weight),
            "; it must lie in [0, 1e6].");
    sum += weight;
  }
  Require(sum != 0, "Loss: all weights are 0; one of l1, l2, dssim, ffl and contrast must not be.");
}

Loss Loss::Parse(const std::string& text)
{
  Loss loss{0, 0, 0, 0, 0};
  Reader reader(text);
  do
  {
    double factor = 1;
    const bool sound = !reader.TakeNumber(factor) || reader.Take('*');
    const std::string name = reader.TakeName();
    const Term* found = nullptr;
    for (const Term& term : terms)
    {
      found = name == term.name ? &term : found;
    }
    Require(sound && found, "Loss: ", Quoted(text),
            " is not a sum of l1, l2, dssim, ffl and contrast, each with a factor if wanted, as in "
            "\"0.8*l1+0.2*dssim\".");
    if (!(factor >= 0))  // a second naming must not hide it
    {
      throw Error("Loss: in " + Quoted(text) + " the factor of " + name + " is " + ExactNumber(factor) +
                  "; it must lie in [0, 1e6].");
    }
    loss.*found->weight += factor;
  } while (reader.Take('+'));
  Require(reader.AtEnd(), "Loss: in ", Quoted(text), " something follows the last term; terms are added with \"+\".");
  loss.Validate();
  return loss;
}

std::string Loss::ToString() const
{
  std::string text;
  for (const Term& term : terms)
  {
    if (const double weight = this->*term.weight; weight != 0)
    {
      text += text.empty() ? "" : "+";
      text += weight == 1 ? "" : ExactNumber(weight) + "*";
      text += term.name;
    }
  }
  return text.empty() ? "0*l1" : text;
}

}  // namespace bigus
