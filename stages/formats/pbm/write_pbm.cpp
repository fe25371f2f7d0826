#include <fmt/format.h>

#include <cstring>
#include <string>

#include "stages/formats/pbm/pbm.h"
#include "stages/geometry/bits.h"

namespace lamina::write::pbm {
namespace {

class PbmEncoder : public ImageEncoder {
 public:
  Status encode(const RunsView& runs, double dpi_x, double dpi_y, Bytes& file) override {
    const std::string head = fmt::format("P4\n# lamina dpi {:.10g} {:.10g}\n{} {}\n", dpi_x, dpi_y, runs.columns, runs.rows());
    const std::size_t stride = row_bytes(runs.columns);
    file.resize(head.size() + stride * runs.rows());
    std::memcpy(file.data(), head.data(), head.size());
    const std::span<std::byte> rows = std::span(file).subspan(head.size());
    for (std::uint32_t r = 0; r < runs.rows(); ++r) expand_row(runs.row(r), rows.subspan(stride * r, stride));
    return {};
  }
};

}  // namespace

std::unique_ptr<ImageEncoder> make_encoder() { return std::make_unique<PbmEncoder>(); }

}  // namespace lamina::write::pbm
