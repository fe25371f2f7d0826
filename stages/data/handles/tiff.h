// stages/data/handles/tiff.h: an open file of libtiff, and its complaints as text. It lies here because the reader and the
// writer of TIFF are two stages.
#pragma once

#include <tiffio.h>

#include <memory>
#include <string>

namespace lamina {

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
/// nullptr if memory ran out.
TiffOptions strict_tiff_options(std::string& message);

}  // namespace lamina
