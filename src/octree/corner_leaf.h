// The leaf of the window's OpenVDB trees: a mask leaf that carries a CornerBlock.
#pragma once
#include <openvdb/openvdb.h>
#include <openvdb/tree/LeafNodeMask.h>

#include <memory>
#include <type_traits>

#include "octree/corner_block.h"

namespace lamina {

/// OpenVDB's inner nodes address a leaf by its own type, so a derived leaf declares the methods that return it anew,
/// and the iterators over its voxels and (absent) children.
class CornerLeaf : public openvdb::tree::LeafNode<openvdb::ValueMask, 3> {
 public:
  using Base = openvdb::tree::LeafNode<openvdb::ValueMask, 3>;
  using LeafNodeType = CornerLeaf;
  using Ptr = std::shared_ptr<CornerLeaf>;
  using Coord = openvdb::Coord;

  CornerBlock block;

  CornerLeaf() = default;
  explicit CornerLeaf(const Coord& xyz, bool value = false, bool active = false) : Base(xyz, value, active) {}
  CornerLeaf(openvdb::PartialCreate, const Coord& xyz, bool value = false, bool active = false)
      : Base(openvdb::PartialCreate(), xyz, value, active) {}

  CornerLeaf* touchLeaf(const Coord&) { return this; }
  CornerLeaf* probeLeaf(const Coord&) { return this; }
  const CornerLeaf* probeLeaf(const Coord&) const { return this; }
  const CornerLeaf* probeConstLeaf(const Coord&) const { return this; }
  void addLeaf(CornerLeaf*) {}
  template <typename A>
  void addLeafAndCache(CornerLeaf*, A&) {}
  template <typename A>
  CornerLeaf* touchLeafAndCache(const Coord&, A&) {
    return this;
  }
  template <typename A>
  CornerLeaf* probeLeafAndCache(const Coord&, A&) {
    return this;
  }
  template <typename A>
  const CornerLeaf* probeLeafAndCache(const Coord&, A&) const {
    return this;
  }
  template <typename A>
  const CornerLeaf* probeConstLeafAndCache(const Coord&, A&) const {
    return this;
  }
  template <typename NodeT, typename A>
  NodeT* probeNodeAndCache(const Coord&, A&) {
    if constexpr (std::is_same_v<NodeT, CornerLeaf>) return this;
    return nullptr;
  }
  template <typename NodeT, typename A>
  const NodeT* probeConstNodeAndCache(const Coord&, A&) const {
    if constexpr (std::is_same_v<NodeT, CornerLeaf>) return this;
    return nullptr;
  }

  using ValueOnIter = Base::ValueIter<MaskOnIter, CornerLeaf, const bool>;
  using ValueOnCIter = Base::ValueIter<MaskOnIter, const CornerLeaf, const bool>;
  using ValueOffIter = Base::ValueIter<MaskOffIter, CornerLeaf, const bool>;
  using ValueOffCIter = Base::ValueIter<MaskOffIter, const CornerLeaf, const bool>;
  using ValueAllIter = Base::ValueIter<MaskDenseIter, CornerLeaf, const bool>;
  using ValueAllCIter = Base::ValueIter<MaskDenseIter, const CornerLeaf, const bool>;
  using ChildOnIter = Base::ChildIter<MaskOnIter, CornerLeaf>;
  using ChildOnCIter = Base::ChildIter<MaskOnIter, const CornerLeaf>;
  using ChildOffIter = Base::ChildIter<MaskOffIter, CornerLeaf>;
  using ChildOffCIter = Base::ChildIter<MaskOffIter, const CornerLeaf>;
  using ChildAllIter = Base::DenseIter<CornerLeaf, bool>;
  using ChildAllCIter = Base::DenseIter<const CornerLeaf, const bool>;

  ValueOnCIter cbeginValueOn() const { return {getValueMask().beginOn(), this}; }
  ValueOnCIter beginValueOn() const { return {getValueMask().beginOn(), this}; }
  ValueOnIter beginValueOn() { return {getValueMask().beginOn(), this}; }
  ValueOnCIter cendValueOn() const { return {getValueMask().endOn(), this}; }
  ValueOnCIter endValueOn() const { return {getValueMask().endOn(), this}; }
  ValueOnIter endValueOn() { return {getValueMask().endOn(), this}; }
  ValueOffCIter cbeginValueOff() const { return {getValueMask().beginOff(), this}; }
  ValueOffCIter beginValueOff() const { return {getValueMask().beginOff(), this}; }
  ValueOffIter beginValueOff() { return {getValueMask().beginOff(), this}; }
  ValueOffCIter cendValueOff() const { return {getValueMask().endOff(), this}; }
  ValueOffCIter endValueOff() const { return {getValueMask().endOff(), this}; }
  ValueOffIter endValueOff() { return {getValueMask().endOff(), this}; }
  ValueAllCIter cbeginValueAll() const { return {getValueMask().beginDense(), this}; }
  ValueAllCIter beginValueAll() const { return {getValueMask().beginDense(), this}; }
  ValueAllIter beginValueAll() { return {getValueMask().beginDense(), this}; }
  ValueAllCIter cendValueAll() const { return {getValueMask().endDense(), this}; }
  ValueAllCIter endValueAll() const { return {getValueMask().endDense(), this}; }
  ValueAllIter endValueAll() { return {getValueMask().endDense(), this}; }
  ChildOnCIter cbeginChildOn() const { return {getValueMask().endOn(), this}; }
  ChildOnCIter beginChildOn() const { return {getValueMask().endOn(), this}; }
  ChildOnIter beginChildOn() { return {getValueMask().endOn(), this}; }
  ChildOnCIter cendChildOn() const { return {getValueMask().endOn(), this}; }
  ChildOnCIter endChildOn() const { return {getValueMask().endOn(), this}; }
  ChildOnIter endChildOn() { return {getValueMask().endOn(), this}; }
  ChildOffCIter cbeginChildOff() const { return {getValueMask().endOff(), this}; }
  ChildOffCIter beginChildOff() const { return {getValueMask().endOff(), this}; }
  ChildOffIter beginChildOff() { return {getValueMask().endOff(), this}; }
  ChildOffCIter cendChildOff() const { return {getValueMask().endOff(), this}; }
  ChildOffCIter endChildOff() const { return {getValueMask().endOff(), this}; }
  ChildOffIter endChildOff() { return {getValueMask().endOff(), this}; }
  ChildAllCIter cbeginChildAll() const { return {getValueMask().beginDense(), this}; }
  ChildAllCIter beginChildAll() const { return {getValueMask().beginDense(), this}; }
  ChildAllIter beginChildAll() { return {getValueMask().beginDense(), this}; }
  ChildAllCIter cendChildAll() const { return {getValueMask().endDense(), this}; }
  ChildAllCIter endChildAll() const { return {getValueMask().endDense(), this}; }
  ChildAllIter endChildAll() { return {getValueMask().endDense(), this}; }
};

using CornerTree = openvdb::tree::Tree<
    openvdb::tree::RootNode<openvdb::tree::InternalNode<openvdb::tree::InternalNode<CornerLeaf, 3>, 4>>>;

}  // namespace lamina
