// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
// The plugin in a program of your own: a phantom, its field and an oblique slice, drawn by ParaView's view.
//   slice BIGUS.so PICTURE.png
#include "vtkInitializationHelper.h"
#include "vtkProcessModule.h"
#include "vtkSMParaViewPipelineControllerWithRendering.h"
#include "vtkSMPluginManager.h"
#include "vtkSMPropertyHelper.h"
#include "vtkSMProxyManager.h"
#include "vtkSMRenderViewProxy.h"
#include "vtkSMSession.h"
#include "vtkSMSessionProxyManager.h"
#include "vtkSMSourceProxy.h"

/// A source, filter or view with its defaults and these properties, each a name and its numbers.
template <class Proxy>
vtkSmartPointer<Proxy> Make(const char* group, const char* name, vtkSMProxy* input,
                            const std::vector<std::pair<const char*, std::vector<double>>>& properties)
{
  vtkNew<vtkSMParaViewPipelineControllerWithRendering> controller;
  auto* made = vtkSMProxyManager::GetProxyManager()->GetActiveSessionProxyManager()->NewProxy(group, name);
  controller->PreInitializeProxy(made);
  vtkSMPropertyHelper(made, "Input", true).Set(input);  // quietly: what has no input takes none
  controller->PostInitializeProxy(made);
  for (const auto& [property, values] : properties)
  {
    for (unsigned int k = 0; k < values.size(); ++k)
    {
      vtkSMPropertyHelper(made, property).Set(k, values[k]);
    }
  }
  made->UpdateVTKObjects();
  return vtkSmartPointer<Proxy>::Take(Proxy::SafeDownCast(made));
}

int main(int, char* argv[])
{
  vtkInitializationHelper::Initialize(argv[0], vtkProcessModule::PROCESS_BATCH);
  vtkSMSession::ConnectToSelf();
  vtkSMProxyManager::GetProxyManager()->GetPluginManager()->LoadLocalPlugin(argv[1]);
  const auto sweep = Make<vtkSMSourceProxy>("sources", "BIGUSPhantom", nullptr,
                                            {{"NumberOfFrames", {33}}, {"PixelSize", {0.4}}, {"FrameSize", {96, 72}}});
  const auto field =
      Make<vtkSMSourceProxy>("filters", "BIGUSTrainer", sweep, {{"Automatic", {0}}, {"Iterations", {200}}});
  field->UpdatePipeline();  // the slice begins in the middle of the field, which must be known
  const auto slice = Make<vtkSMSourceProxy>("filters", "BIGUSFieldSlice", field, {{"Normal", {0.6, 0.2, 0.8}}});
  const auto view = Make<vtkSMRenderViewProxy>("views", "RenderView", nullptr,
                                               {{"CameraPosition", {0.8, -0.4, -1.6}}, {"CameraViewUp", {0, -1, 0}}});
  vtkSMProxy* shown = vtkNew<vtkSMParaViewPipelineControllerWithRendering>()->Show(slice, 0, view);
  vtkSMPropertyHelper(shown, "Ambient").Set(0.4);
  shown->UpdateVTKObjects();
  view->ResetCamera();
  return view->WriteImage(argv[2], "vtkPNGWriter");  // 0: no error
}
