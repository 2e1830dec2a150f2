/** @file ht_result.h
 *  What a command answers.
 */
#ifndef HT_RESULT_H
#define HT_RESULT_H

/** Result of a command or an initialisation. */
typedef enum {
    HT_OK = 0,
    HT_ERROR_ID = 1,         /**< no such parameter */
    HT_ERROR_VALUE = 2,      /**< not finite, out of range or not a choice */
    HT_ERROR_STATE = 3,      /**< not allowed in this state */
    HT_ERROR_CONFIG = 4,     /**< parameters do not fit together (e.g. bands) */
    HT_ERROR_PORT = 5,       /**< the hardware cannot realise the set-up */
    HT_ERROR_TURNING = 6,    /**< start refused: the machine is turning */
    HT_ERROR_TRIP = 7,       /**< start or clear refused: the trip pin is low */
    HT_ERROR_STORE = 8,      /**< this image keeps no parameters, or writing them failed */
    HT_ERROR_PREDICTION = 9, /**< the scheme needs load_mode = shadow and predict = on */
    HT_ERROR_SAMPLING = 10,  /**< the scheme needs a higher f_isr_Hz for this machine */
    HT_ERROR_RESTART = 11    /**< start refused: too many trips by hardware */
} ht_result;

#endif
