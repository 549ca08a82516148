// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
#include "Core/Phantom/PhantomOptions.h"

#include <cctype>
#include <string>

#include "Core/Model/Error.h"
#include "Core/Numerics/Format.h"
#include "Core/Phantom/PhantomOptionList.h"

namespace bigus
{

namespace
{

void Check(const PhantomNumber& number, double value)
{
  if (!(value >= number.least && value <= number.most) && !(number.zeroIsProbes && value == 0))  // true for NaN
  {
    const auto text = [](double one) { return Format("%.16g", one); };
    std::string name = number.name;
    name[0] = static_cast<char>(std::tolower(static_cast<unsigned char>(name[0])));
    throw Error("phantom: " + name + " is " + text(value) + "; it must lie between " + text(number.least) + " and " +
                text(number.most) + (*number.unit ? " " : "") + number.unit +
                (number.zeroIsProbes ? " (or 0 for the probe's default)." : "."));
  }
}

void Check(const PhantomNumber& number, const std::array<double, 3>& values)
{
  for (const double value : values)
  {
    Check(number, value);
  }
}

}  // namespace

void PhantomOptions::Validate() const
{
  Check({"Scene", "", "", 0, 2}, static_cast<int>(scene));
  Check({"Probe", "", "", 0, 2}, static_cast<int>(probe));
  ForEachPhantomOption(*this, [](const PhantomNumber& number, const auto& value) { Check(number, value); });
}

}  // namespace bigus
