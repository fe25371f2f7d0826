#include "stages/write/slice_format.h"

namespace lamina::write {

void encode_alone(const SliceEncoder& encoder, const SliceHead& head, const SliceLayer& layer, Buffer<char>& out) {
  SliceHead own = head;
  own.layers = 1;
  own.first_bottom = layer.layer.bottom;
  encoder.head(own, out);
  encoder.layer(own, layer, out);
  encoder.tail(own, out);
}

}  // namespace lamina::write
