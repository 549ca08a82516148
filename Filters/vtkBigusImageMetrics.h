// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * @class   vtkBigusImageMetrics
 * @brief   How close an ultrasound image is to the truth: PSNR, SSIM and texture
 *
 * Input 0 is the image, input 1 the truth, of equal dimensions; both with one component, unsigned char
 * (divided by 255) or float in [0, 1]. The output is a table with one row for each z slice and the columns
 *
 * - Slice: index along z
 * - PSNR: 10 log10(1 / mean squared error), dB; infinite for equal slices
 * - SSIM: mean structural similarity, Gaussian window of 11 x 11 pixels; slices must be at least that large
 * - BFS: backscatter fidelity, 0.4 MeanContrast + 0.4 ContrastDistribution + 0.2 Rayleigh
 * - MeanContrast, ContrastDistribution, Rayleigh: its three terms, 0 to 1
 * - ContrastRatio: mean speckle contrast of the image / of the truth
 * - ContrastDistance: Wasserstein-1 distance of the contrasts of patches
 * - IntensityDistance: Wasserstein-1 distance of the histograms of lit pixels, in intensity
 * - SpectrumDifference: mean difference of the radial power spectra, dB, without sign
 * - HighFrequencyPower: power above half of Nyquist's frequency / the truth's; 0 is smooth
 *
 * and, once for the image and once for the truth (ImageContrastMean, TruthContrastMean, ...)
 *
 * - ContrastMean, ContrastStd, ContrastQ05, Q25, Q50, Q75, Q95: speckle contrast std / mean over patches,
 *   its mean, standard deviation and quantiles; 0.523 for Rayleigh speckle
 * - Mean, Std, Snr, LocalSnr, Skewness, Kurtosis: intensity of lit pixels; Snr = Mean / Std, LocalSnr
 *   its median over patches (both infinite for a flat image), excess kurtosis
 * - Spectrum: 16 components, power at 1/32, 2/32, ... 1/2 cycles a pixel; white noise has its variance
 *
 * Core/Metrics/Texture.h has the exact meaning of patches, lit pixels and power. The getters give mean and, for PSNR
 * and SSIM, standard deviation over slices (0 for one slice).
 */
#ifndef vtkBigusImageMetrics_h
#define vtkBigusImageMetrics_h

#include "vtkBigusFiltersModule.h"  // for the export macro
#include "vtkTableAlgorithm.h"

#ifdef VTK_ABI_NAMESPACE_BEGIN  // from VTK 9.2 on
VTK_ABI_NAMESPACE_BEGIN
#endif
class vtkAlgorithmOutput;
class vtkDataObject;
#ifdef VTK_ABI_NAMESPACE_END
VTK_ABI_NAMESPACE_END
#endif

class VTKBIGUSFILTERS_EXPORT vtkBigusImageMetrics : public vtkTableAlgorithm
{
public:
  static vtkBigusImageMetrics* New();
  vtkTypeMacro(vtkBigusImageMetrics, vtkTableAlgorithm);
  void PrintSelf(ostream& os, vtkIndent indent) override;

  ///@{
  /**
   * The truth (input 1).
   */
  void SetTruthConnection(vtkAlgorithmOutput* port) { this->SetInputConnection(1, port); }
  void SetTruthData(vtkDataObject* image) { this->SetInputData(1, image); }
  ///@}

  ///@{
  /**
   * Results of the last update: mean and standard deviation over slices.
   */
  vtkGetMacro(PSNR, double);
  vtkGetMacro(PSNRStandardDeviation, double);
  vtkGetMacro(SSIM, double);
  vtkGetMacro(SSIMStandardDeviation, double);
  vtkGetMacro(BFS, double);
  vtkGetMacro(MeanContrast, double);
  vtkGetMacro(ContrastDistribution, double);
  vtkGetMacro(Rayleigh, double);
  vtkGetMacro(ContrastRatio, double);
  vtkGetMacro(ContrastDistance, double);
  vtkGetMacro(IntensityDistance, double);
  vtkGetMacro(SpectrumDifference, double);
  vtkGetMacro(HighFrequencyPower, double);
  ///@}

protected:
  vtkBigusImageMetrics();
  ~vtkBigusImageMetrics() override = default;

  int FillInputPortInformation(int port, vtkInformation* info) override;
  int RequestUpdateExtent(vtkInformation*, vtkInformationVector**, vtkInformationVector*) override;
  int RequestData(vtkInformation*, vtkInformationVector**, vtkInformationVector*) override;

  double PSNR = 0;
  double PSNRStandardDeviation = 0;
  double SSIM = 0;
  double SSIMStandardDeviation = 0;
  double BFS = 0;
  double MeanContrast = 0;
  double ContrastDistribution = 0;
  double Rayleigh = 0;
  double ContrastRatio = 0;
  double ContrastDistance = 0;
  double IntensityDistance = 0;
  double SpectrumDifference = 0;
  double HighFrequencyPower = 0;

private:
  vtkBigusImageMetrics(const vtkBigusImageMetrics&) = delete;
  void operator=(const vtkBigusImageMetrics&) = delete;
};

#endif
