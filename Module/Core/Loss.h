// What training makes small.
#pragma once

namespace bigus
{

/// Training losses on intensity, mean over pixels.
enum class LossKind
{
  L1,  ///< |I - I_gt|
  L2   ///< (I - I_gt)^2
};

}  // namespace bigus
