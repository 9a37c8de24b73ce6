#include "meshes/openmesh_quiet.h"

#include <OpenMesh/Core/System/omstream.hh>

namespace lamina::meshes {
namespace {

std::mutex& openmesh_mutex() {
  static std::mutex mutex;
  return mutex;
}

}  // namespace

QuietOpenMesh::QuietOpenMesh() : lock_(openmesh_mutex()) {
  omerr().disable();
  omlog().disable();
}

QuietOpenMesh::~QuietOpenMesh() {
  omerr().enable();
  omlog().enable();
}

}  // namespace lamina::meshes
