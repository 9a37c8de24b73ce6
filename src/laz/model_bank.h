// Models by context, made when a context comes up: most of them never do.
#pragma once
#include <array>
#include <cstddef>
#include <memory>

#include "laz/arithmetic_model.h"

namespace lamina::laz {

template <unsigned kSymbols, unsigned kContexts>
class ModelBank {
 public:
  SymbolModel<kSymbols>& operator[](unsigned context) {
    std::unique_ptr<SymbolModel<kSymbols>>& model = models_[context];
    if (model == nullptr) model = std::make_unique<SymbolModel<kSymbols>>();
    return *model;
  }

 private:
  std::array<std::unique_ptr<SymbolModel<kSymbols>>, kContexts> models_;
};

}  // namespace lamina::laz
