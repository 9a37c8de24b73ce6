// Whether a .vdb file's lengths are true, before OpenVDB believes them.
#pragma once
#include <istream>

namespace lamina::volume {

/// Walks through the file as OpenVDB's reader will: every length must fit into the file and every compressed piece must
/// hold as many bytes as its node wants, where the reader would run over the end of its arrays. Values are not
/// looked at; of grids of types that OpenVDB does not come with only what precedes the tree is. Throws
/// std::runtime_error saying what is wrong, std::ios::failure where the file ends too early. The stream has exceptions
/// on, stands at the file's beginning, and stands there again afterwards.
void check_vdb(std::istream& file);

}  // namespace lamina::volume
