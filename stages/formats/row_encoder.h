// stages/formats/row_encoder.h: encoders of formats whose rows are bits, one after another.
#pragma once

#include "stages/formats/image_format.h"
#include "stages/geometry/bits.h"

namespace lamina::formats {

/// Encodes runs and rows of bits alike.
class RowEncoder : public ImageEncoder {
 public:
  Status encode(const RunsView& runs, double dpi_x, double dpi_y, Bytes& file) final {
    return encode_rows(runs, dpi_x, dpi_y, file);
  }
  Status encode(const BitRows& rows, double dpi_x, double dpi_y, Bytes& file) final {
    return encode_rows(rows, dpi_x, dpi_y, file);
  }

 private:
  /// As encode().
  virtual Status encode_rows(RowBits image, double dpi_x, double dpi_y, Bytes& file) = 0;
};

}  // namespace lamina::formats
