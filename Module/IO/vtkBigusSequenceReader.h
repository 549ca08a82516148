// SPDX-FileCopyrightText: BIGUS authors
// SPDX-License-Identifier: BSD-3-Clause
/**
 * @class   vtkBigusSequenceReader
 * @brief   reads a tracked ultrasound sweep
 *
 * The output is a stack of frames, extent (0, W-1, 0, H-1, 0, N-1), spacing 1 and origin 0, whose third axis
 * counts frames: it has no place in space of its own. Where the frames lie is in the field data:
 *
 * - `ImageToReference`: double, 16 components row-major, N tuples. Maps a 0-based pixel index (i, j, 0, 1) to mm.
 * Absent only where there are no poses (see RequirePoses).
 * - `Timestamp`: double, N tuples, seconds. Only when every frame has one.
 * - `Status`: unsigned char, N tuples. 1 = usable, 0 = rejected (see KeepRejectedFrames).
 * - `SourceFrame`: int, N tuples. The frame's 0-based index in the file.
 * - `Mask`: unsigned char, W * H tuples. 0 = never lit or clipped away. Only when AutoMask or a clip is on.
 *
 * Formats: MetaImage sequences as written by Plus, IGSIO and 3D Slicer (`.igs.mha`, `.mha`, `.mhd`), NRRD
 * sequences with the same per-frame fields (`.nrrd`, `.seq.nrrd`, `.nhdr`), and a CSV of poses with PNG
 * images. Scalars are one component of unsigned char, unsigned short or float. Colours become grey, short becomes
 * unsigned short. Pixels are brought to the marked-far (MF) order whatever the file's orientation flag says, as Plus does, because the transforms of a
 * sequence refer to that order. See README.md beside this file for the details and for what is not supported.
 *
 * A frame is rejected, not repaired, when a transform it needs is absent, has a status other than OK, or
 * gives a pose that is not finite, not affine or spans no plane. The report says how many and why. When
 * no frame is left the reader fails. A picture has two axes: where the third column of a pose is zero or points the other
 * way, it is made from the first two, with a warning.
 *
 * The whole sweep is always produced, whatever extent is asked for. What the report below returns is valid
 * after UpdateInformation(), also when that failed because all frames were rejected.
 */
#ifndef vtkBigusSequenceReader_h
#define vtkBigusSequenceReader_h

#include "vtkBigusIOModule.h"
#include "vtkBigusTrackedReader.h"

#ifdef VTK_ABI_NAMESPACE_BEGIN  // from VTK 9.2 on
VTK_ABI_NAMESPACE_BEGIN
#endif
class vtkImageData;
#ifdef VTK_ABI_NAMESPACE_END
VTK_ABI_NAMESPACE_END
#endif

class VTKBIGUSIO_EXPORT vtkBigusSequenceReader : public vtkBigusTrackedReader
{
public:
  static vtkBigusSequenceReader* New();
  vtkTypeMacro(vtkBigusSequenceReader, vtkBigusTrackedReader);
  void PrintSelf(ostream& os, vtkIndent indent) override;

  /**
   * 1 when the file says that it is a sequence: MetaImage or NRRD with a transform of a frame in the header, or a table of
   * poses. Volumes are left to VTK's readers. With RequirePosesOff 1 for every MetaImage, NRRD and PNG.
   */
  virtual int CanReadFile(VTK_FILEPATH const char* fileName);

  vtkImageData* GetOutput();

  ///@{
  /**
   * Off: a file that holds no transform is read too, without `ImageToReference`: a plain MetaImage or NRRD
   * image or volume as a stack of its slices, a PNG image as a stack of one. A file that holds
   * transforms is read as ever. Default: on.
   */
  vtkSetMacro(RequirePoses, vtkTypeBool);
  vtkGetMacro(RequirePoses, vtkTypeBool);
  vtkBooleanMacro(RequirePoses, vtkTypeBool);
  ///@}

  ///@{
  /**
   * Put rejected frames into the output too, with `Status` 0 and, where there is no pose, NaN. Default: off.
   */
  vtkSetMacro(KeepRejectedFrames, vtkTypeBool);
  vtkGetMacro(KeepRejectedFrames, vtkTypeBool);
  vtkBooleanMacro(KeepRejectedFrames, vtkTypeBool);
  ///@}

  ///@{
  /**
   * Mark pixels that are 0 in every accepted frame as outside the image, in `Mask`. Default: on.
   */
  vtkSetMacro(AutoMask, vtkTypeBool);
  vtkGetMacro(AutoMask, vtkTypeBool);
  vtkBooleanMacro(AutoMask, vtkTypeBool);
  ///@}

  ///@{
  /**
   * The stored pixel that is shown as white. Pixels are scaled so that it becomes the largest of their type: 255, 65535, or
   * 1 of float. A larger pixel is an error. 0: found from the pixels, with a warning, where they have 16 bits and reach
   * 64 to 16383, because data of 8, 10, 12 or 14 bits are often kept in 16; else pixels stay as they are. Default: 0.
   */
  vtkSetClampMacro(PixelRange, double, 0, 1e30);
  vtkGetMacro(PixelRange, double);
  ///@}

  enum ClipModeType
  {
    CLIP_NONE = 0,
    CLIP_RECTANGLE = 1,
    CLIP_FAN = 2
  };

  ///@{
  /**
   * Pixels outside the clip shape become 0 and are marked in `Mask`. Default: none.
   */
  vtkSetClampMacro(ClipMode, int, CLIP_NONE, CLIP_FAN);
  vtkGetMacro(ClipMode, int);
  void SetClipModeToNone() { this->SetClipMode(CLIP_NONE); }
  void SetClipModeToRectangle() { this->SetClipMode(CLIP_RECTANGLE); }
  void SetClipModeToFan() { this->SetClipMode(CLIP_FAN); }
  ///@}

  ///@{
  /**
   * The clip rectangle, pixels: first column, first row (0-based), number of columns, number of rows, in MF
   * order. A part outside the image is ignored; an empty intersection is an error. Default: 0, 0, 0, 0.
   */
  vtkSetVector4Macro(ClipRectangle, int);
  vtkGetVector4Macro(ClipRectangle, int);
  ///@}

  ///@{
  /**
   * The clip fan, in MF order: its apex (i, j) in pixels (may lie outside the image), inner and outer radius
   * in pixels, and first and last angle in degrees, measured from +j (away from the probe) towards +i. Needs
   * 0 <= inner < outer and -180 <= first < last <= 180. Defaults: (0, 0), (0, 0), (-180, 180).
   */
  vtkSetVector2Macro(FanApex, double);
  vtkGetVector2Macro(FanApex, double);
  vtkSetVector2Macro(FanRadii, double);
  vtkGetVector2Macro(FanRadii, double);
  vtkSetVector2Macro(FanAngles, double);
  vtkGetVector2Macro(FanAngles, double);
  ///@}

  ///@{
  /**
   * For a CSV of poses: the folder with the PNG images. Default: the CSV's own folder. Names in the `image`
   * column are relative to it and must not leave it. Without that column and without ImagePattern the
   * folder's PNG files are taken in the order of their names, frame_2 before frame_10, and must be as many as the rows;
   * then the folder has to be given.
   */
  vtkSetFilePathMacro(ImageFolder);
  vtkGetFilePathMacro(ImageFolder);
  ///@}

  ///@{
  /**
   * For a CSV of poses: the image of 0-based row n, by a pattern with one %d or %0Nd in which n replaces the
   * conversion, such as frame_%04d.png, relative to ImageFolder. Takes precedence over the `image` column.
   * Default: none.
   */
  vtkSetFilePathMacro(ImagePattern);
  vtkGetFilePathMacro(ImagePattern);
  ///@}

  /**
   * How many frames the file holds, and how many of them were accepted and rejected.
   */
  int GetNumberOfFramesInFile();
  int GetNumberOfAcceptedFrames();
  int GetNumberOfRejectedFrames();

  /**
   * Why frames were rejected: the reasons, how many frames each took, and one line naming them all, such as
   * "3 of 21 frames rejected: 2 for ProbeToTracker status INVALID (frames 4, 5), 1 for a pose that is not
   * finite (frame 7)"; empty when there was none.
   */
  int GetNumberOfRejectionReasons();
  const char* GetRejectionReason(int index);
  int GetRejectionCount(int index);
  const char* GetRejectionSummary();

  /**
   * The transforms there are, such as "ProbeToTracker", and where each comes from: "frames" (one per frame),
   * "header" or "config".
   */
  int GetNumberOfTransforms();
  const char* GetTransformName(int index);
  const char* GetTransformSource(int index);

  ///@{
  /**
   * Fields of the header that are read past, such as the name of a person or the date of a recording: none of them gets
   * into any output. Names are without Seq_Frame0000_, and "comment" stands for lines of comment; of the value the first that there is,
   * both shortened to 60 bytes; and how many frames (or lines) have it.
   */
  int GetNumberOfUnusedFields();
  const char* GetUnusedFieldName(int index);
  const char* GetUnusedFieldValue(int index);
  int GetUnusedFieldCount(int index);
  ///@}

  /**
   * A coordinate frame of the file, such as CroppedImage, that says by its name that the images may have been cut out of
   * larger ones, so that poses should lead from there (FromFrame). Empty when there is none or poses lead from it.
   */
  const char* GetCroppedFrame();

  /**
   * How many accepted frames have a third column of their pose that was made, because in the file it is zero or points the
   * other way.
   */
  int GetNumberOfMadeAxes();

  /**
   * The size of a pixel along i and j, mm, as the header states it (ElementSpacing, spacings, space directions); 0 where it
   * does not. Nothing is made of it: see GetSpacingDoubt and ImageSpacing.
   */
  void GetHeaderSpacing(double spacing[2]);

  /**
   * A sentence that names both sizes of a pixel where the header states another than the transforms, which is used (see
   * ImageSpacing); else empty.
   */
  const char* GetSpacingDoubt();

  /**
   * The chain used, such as "Image -> Probe -> Tracker -> Reference"; empty when there is none.
   */
  const char* GetTransformChain();

  /**
   * What the file says of its pixels: format, encoding (raw, zlib, gzip, png), element type (unsigned char, unsigned
   * short, short, float, and "3 channels" of colours), orientation flag as in the file, and frame size in pixels.
   */
  const char* GetFormat();
  const char* GetEncoding();
  const char* GetElementType();
  const char* GetOrientation();
  void GetFrameSize(int size[2]);

  /**
   * The stored pixel that was shown as white (see PixelRange), once the pixels have been read; 0 where they stayed as they
   * are.
   */
  double GetUsedPixelRange();

  /**
   * Geometry of the accepted frames, mm: pixel size along i and j (mean over frames); distance between successive
   * planes, at the image centre along the normal, as the trainer measures it (minimum, median, maximum; 0 for one
   * frame); length of the path of the frames' centres; and the box of all frame corners (xmin, xmax, ymin, ymax, zmin,
   * zmax).
   */
  void GetPixelSize(double size[2]);
  void GetPlaneSpacing(double spacing[3]);
  double GetPathLength();
  void GetBounds(double bounds[6]);

  /**
   * Whether every accepted frame has a timestamp, and the seconds from the first to the last.
   */
  bool GetHasTimestamps();
  double GetDuration();

protected:
  vtkBigusSequenceReader();
  ~vtkBigusSequenceReader() override;

  int FillOutputPortInformation(int port, vtkInformation* info) override;
  int RequestInformation(vtkInformation*, vtkInformationVector**, vtkInformationVector*) override;
  int RequestData(vtkInformation*, vtkInformationVector**, vtkInformationVector*) override;

  char* ImageFolder = nullptr;
  char* ImagePattern = nullptr;
  vtkTypeBool RequirePoses = 1;
  vtkTypeBool KeepRejectedFrames = 0;
  double PixelRange = 0;
  vtkTypeBool AutoMask = 1;
  int ClipMode = CLIP_NONE;
  int ClipRectangle[4] = {0, 0, 0, 0};
  double FanApex[2] = {0, 0};
  double FanRadii[2] = {0, 0};
  double FanAngles[2] = {-180, 180};

private:
  vtkBigusSequenceReader(const vtkBigusSequenceReader&) = delete;
  void operator=(const vtkBigusSequenceReader&) = delete;

  class vtkInternals;
  vtkInternals* Internals;
};

#endif
