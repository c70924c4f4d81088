// How many samples an output layer is solved on at a time, and how often.
//
//   p unknowns (and q right-hand sides):  a share has 16 p equations
//
// of which the positions of a convolution are one: neighbours are alike, and one
// sample, which has thousands, does not determine a layer.
// The loss of fresh samples is then about 1/16 above that of the best layer. A
// solution takes 2 n + 4 p (p + q) operations a sample, a step 6 n. Pull-backs
// count as the network does, because a solution pulls back each of its samples
// once, as a step does.
#ifndef INVGRAD_OUTPUT_LAYER_SHARE_H_
#define INVGRAD_OUTPUT_LAYER_SHARE_H_

#include "invgrad/model.h"

namespace invgrad {

// `is_proxy`: of the targets of a pull-back, which are a problem in x.
int SamplesOfShare(const Model& model, bool is_proxy);

// The samples of a share that are linearized at a time.
int SamplesOfBlock(const Model& model, bool is_proxy);

// The number of steps that take about twice as long as a solution.
int OutputLayerPeriod(const Model& model,
                      bool is_proxy,
                      int batch_size,
                      int num_samples);

// The memory of a solution in bytes, without that of the samples.
double OutputLayerBytes(const Model& model, bool is_proxy);

// The memory of a solution and a projection on a batch: copies of J_C, which has
// `num_outputs` rows a sample.
double ProjectionBytes(const Model& model, double num_outputs, int batch_size);

}  // namespace invgrad

#endif  // INVGRAD_OUTPUT_LAYER_SHARE_H_
