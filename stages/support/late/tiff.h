// stages/support/late/tiff.h: libtiff, loaded when it is first needed, an open file of it, and its complaints as text. It lies
// here because the reader and the writer of TIFF are two stages.
#pragma once

#include <tiffio.h>

#include <memory>
#include <string>

#include "stages/support/late/late.h"

#define LAMINA_TIFF(each)                                                                                                   \
  each(TIFFOpenOptionsAlloc) each(TIFFOpenOptionsFree) each(TIFFOpenOptionsSetMaxSingleMemAlloc)                            \
      each(TIFFOpenOptionsSetErrorHandlerExtR) each(TIFFOpenOptionsSetWarningHandlerExtR) each(TIFFClientOpenExt)           \
          each(TIFFFdOpenExt) each(TIFFClose) each(TIFFFlush) each(TIFFGetField) each(TIFFGetFieldDefaulted)                \
              each(TIFFSetField) each(TIFFGetStrileByteCount) each(TIFFGetStrileOffset) each(TIFFIsTiled)                   \
                  each(TIFFLastDirectory) each(TIFFNumberOfStrips) each(TIFFReadScanline) each(TIFFScanlineSize)            \
                      each(TIFFWriteEncodedStrip) each(TIFFWriteRawStrip) each(TIFFSetSubDirectory) each(TIFFReadDirectory) \
                          each(TIFFCurrentDirOffset)

namespace lamina {

LAMINA_TIFF(LAMINA_LATE_DECLARED)

struct CloseTiff {
  void operator()(TIFF* tiff) const { TIFFClose(tiff); }
};
using TiffHandle = std::unique_ptr<TIFF, CloseTiff>;

struct FreeTiffOptions {
  void operator()(TIFFOpenOptions* options) const { TIFFOpenOptionsFree(options); }
};
using TiffOptions = std::unique_ptr<TIFFOpenOptions, FreeTiffOptions>;

/// For TIFFOpen and its kin: the first error goes into `message` instead of to the terminal. So does the first warning,
/// because libtiff only warns of a tag cut off and of G4 rows of wrong length; tags that it does not know are fine.
/// Loads libtiff; nothing of it is called before. nullptr if memory ran out or libtiff cannot
/// be loaded; errno has a shortage.
TiffOptions strict_tiff_options(std::string& message);

}  // namespace lamina
