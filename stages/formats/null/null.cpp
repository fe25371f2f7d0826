#include "stages/formats/null/null.h"

namespace lamina::formats::null {
namespace {

class NullEncoder : public ImageEncoder {
 public:
  Status encode(const RunsView&, double, double, Bytes& file) override {
    file.clear();
    return {};
  }
};

}  // namespace

std::unique_ptr<ImageEncoder> make_encoder() { return std::make_unique<NullEncoder>(); }

}  // namespace lamina::formats::null
