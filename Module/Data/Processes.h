// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The processes of a controller of VTK, as Core knows them. How they speak with each other is registered by who can.
#pragma once

#include <memory>

#include "Core/Engine/Exchange.h"
#include "vtkBigusDataModule.h"

#ifdef VTK_ABI_NAMESPACE_BEGIN  // from VTK 9.2 on
VTK_ABI_NAMESPACE_BEGIN
#endif
class vtkMultiProcessController;
#ifdef VTK_ABI_NAMESPACE_END
VTK_ABI_NAMESPACE_END
#endif

namespace bigus
{

using ExchangeFactory = std::unique_ptr<Exchange> (*)(vtkMultiProcessController*);
VTKBIGUSDATA_EXPORT void RegisterExchange(ExchangeFactory factory);

/// Whether processes can work together here.
VTKBIGUSDATA_EXPORT bool HasExchange();

/// The processes of the controller, which must outlive this; null: a process alone. Where nobody has registered how several
/// speak with each other, Together throws an Error that says so.
VTKBIGUSDATA_EXPORT std::unique_ptr<Exchange> ExchangeOf(vtkMultiProcessController* controller);

}  // namespace bigus
